"""Studies: many runs of an FMU with uncertain parameters, and their results as data frames.

    import rov_fmu

    results = rov_fmu.run_study("plan.toml", "results")
    results.runs, results.trajectories(), results.bands("u")

Needs the extra `study`: pip install "rov-fmu[study]".
"""
