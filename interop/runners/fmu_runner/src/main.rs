//! fmu-runner, Co-Simulation: variables by name, the state saved and restored on the way.

use fmu_runner::{fmi2Type, Fmu, FmuInstance};
use std::collections::HashMap;
use std::error::Error;
use std::fmt::Write;
use std::fs;
use std::path::Path;

const OUTPUTS: [&str; 11] = [
    "u", "w", "r", "x", "y", "z", "psi", "F_l", "F_r", "F_t", "tau_rear",
];

fn main() -> Result<(), Box<dyn Error>> {
    let fmu = Fmu::unpack(Path::new("videoray.fmu"))?.load(fmi2Type::fmi2CoSimulation)?;
    let rov = FmuInstance::instantiate(&fmu, false)?;
    let signals = fmu.variables();
    let outputs: Vec<_> = OUTPUTS.iter().map(|name| &signals[*name]).collect();

    rov.setup_experiment(0.0, None, None)?;
    for line in fs::read_to_string("parameters.csv")?.lines().skip(1) {
        let (name, value) = line.split_once(',').ok_or("no parameter")?;
        rov.set_reals(&HashMap::from([(&signals[name], value.parse()?)]))?;
    }
    rov.enter_initialization_mode()?;
    rov.exit_initialization_mode()?;

    let manoeuvre = fs::read_to_string("manoeuvre.csv")?;
    let mut lines = manoeuvre.lines();
    let names: Vec<_> = lines.next().ok_or("no header")?.split(',').collect();
    let rows: Vec<Vec<f64>> = lines
        .map(|line| line.split(',').map(str::parse).collect())
        .collect::<Result<_, _>>()?;
    let detour = names.len() - 1;

    let mut result = format!("time,{}\n", OUTPUTS.join(","));
    let mut print = |time: f64| -> Result<(), Box<dyn Error>> {
        let values = rov.get_reals(&outputs)?;
        write!(result, "{time}")?;
        for signal in &outputs {
            write!(result, ",{}", values[signal])?;
        }
        result.push('\n');
        Ok(())
    };
    print(0.0)?;
    for step in rows.windows(2) {
        let (row, start, end) = (&step[0], step[0][0], step[1][0]);
        if row[detour] == 1.0 {
            let states = rov.get_set_state_capability().ok_or("no states")?;
            let state = states.get_state()?;
            rov.set_reals(&HashMap::from([(&signals["u_l"], 1.0)]))?;
            rov.do_step(start, 1.0, false)?;
            states.set_state(state)?;
        }
        let inputs = (1..detour).map(|i| (&signals[names[i]], row[i]));
        rov.set_reals(&inputs.collect())?;
        rov.do_step(start, end - start, true)?;
        print(end)?;
    }
    fs::write("result.csv", result)?;
    Ok(())
}
