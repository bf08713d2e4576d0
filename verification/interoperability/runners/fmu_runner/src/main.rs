//! fmu-runner, Co-Simulation: variables by name, the state saved and restored on the way.

use fmu_runner::{fmi2Type, Fmu, FmuInstance};
use std::collections::HashMap;
use std::error::Error;
use std::fmt::Write;
use std::fs;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let fmu = Fmu::unpack(Path::new("rov.fmu"))?.load(fmi2Type::fmi2CoSimulation)?;
    let rov = FmuInstance::instantiate(&fmu, false)?;
    let signals = fmu.variables();
    let names = fs::read_to_string("outputs.txt")?;
    let names: Vec<_> = names.lines().collect();
    let outputs: Vec<_> = names.iter().map(|name| &signals[*name]).collect();
    let set = |file: &str| -> Result<(), Box<dyn Error>> {
        for line in fs::read_to_string(file)?.lines().skip(1) {
            let (name, value) = line.split_once(',').ok_or("no value")?;
            rov.set_reals(&HashMap::from([(&signals[name], value.parse()?)]))?;
        }
        Ok(())
    };

    rov.setup_experiment(0.0, None, None)?;
    set("parameters.csv")?;
    rov.enter_initialization_mode()?;
    rov.exit_initialization_mode()?;

    let manoeuvre = fs::read_to_string("manoeuvre.csv")?;
    let mut lines = manoeuvre.lines();
    let mut result = format!("time,{}\n", names.join(","));
    let names: Vec<_> = lines.next().ok_or("no header")?.split(',').collect();
    let rows: Vec<Vec<f64>> = lines
        .map(|line| line.split(',').map(str::parse).collect())
        .collect::<Result<_, _>>()?;
    let detour = names.len() - 1;

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
            set("detour.csv")?;
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
