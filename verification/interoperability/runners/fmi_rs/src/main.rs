//! fmi-rs. cs: Co-Simulation, Event Mode where the inputs jump, early return allowed; me: Model Exchange, forward Euler.

use fmi_rs::fmi3::LibraryKind;
use fmi_rs::model_description::fmi3::ModelDescription;
use fmi_rs::sim::fmi3::{
    SimulationSettings, Trajectories, cs, csv, input::StaticInput, me, recorder::Recorder,
};
use fmi_rs::sim::solver::ForwardEulerFactory;
use fmi_rs::zip::extract_zip_archive;
use std::error::Error;
use std::fs;
use std::path::Path;
use std::sync::Arc;

const TOLERANCE: f64 = 1e-9;

fn main() -> Result<(), Box<dyn Error>> {
    extract_zip_archive("rov.fmu", "unzipped")?;
    let description = Arc::new(ModelDescription::from_path(Path::new(
        "unzipped/modelDescription.xml",
    ))?);
    let findings = description.validate();
    if !findings.is_empty() {
        return Err(format!("{findings:#?}").into());
    }
    let jumps = csv::read_csv(fs::File::open("jumps.csv")?, description.clone())?;
    let input = Some(Arc::new(StaticInput::new(jumps, TOLERANCE)));
    let outputs = fs::read_to_string("outputs.txt")?;
    let outputs = outputs
        .lines()
        .map(|name| description.variable_index_by_name(name));
    let outputs = Trajectories::new(description.clone(), outputs.collect::<Result<_, _>>()?);
    let recorder = Arc::new(Recorder::new(outputs));
    let parameters = fs::read_to_string("parameters.csv")?;
    let parameters = parameters
        .lines()
        .skip(1)
        .filter_map(|line| line.split_once(','));
    let settings = SimulationSettings {
        unzipdir: "unzipped".into(),
        model_description: description,
        library_kind: LibraryKind::Native,
        enable_dae: false,
        start_time: 0.0,
        stop_time: 30.0,
        visible: false,
        logging_on: true,
        set_stop_time: true,
        output_interval: 0.1,
        log_time_scale: false,
        tolerance: TOLERANCE,
        set_tolerance: true,
        start_values: parameters
            .map(|(name, value)| (name.into(), value.into()))
            .collect(),
        log_fmi_calls: false,
        intermediate_update: false,
        input_file: None,
        early_return_allowed: true,
        event_mode_used: true,
        log_file: None,
        initial_fmu_state_file: None,
        final_fmu_state_file: None,
    };
    match std::env::args().nth(1).as_deref() {
        Some("cs") => cs::simulate(&settings, input, recorder.clone())?,
        _ => me::simulate(
            &settings,
            &ForwardEulerFactory {
                fixed_step_size: 1e-4,
            },
            input,
            recorder.clone(),
        )?,
    }
    csv::write_csv(&recorder.trajectories.borrow(), "result.csv")?;
    Ok(())
}
