"""One small program for each importer, run in a folder that holds videoray.fmu and the manoeuvre."""
