"""One small program for each importer, run in a folder that holds rov.fmu and the manoeuvre."""
