/* Creation, initialization, values, partial derivatives and states (FMI 2.0, section 2.1). */

FMI2_Export const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

FMI2_Export const char *fmi2GetVersion(void)
{
    return fmi2Version;
}

FMI2_Export fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                                          fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                                          fmi2Boolean visible, fmi2Boolean loggingOn)
{
    (void)fmuResourceLocation; /* everything is in the binary, whatever the location says */
    (void)visible;
    if (functions == NULL) {
        return NULL;
    }
    if (fmuType != fmi2ModelExchange && fmuType != fmi2CoSimulation) {
        REJECT(functions, instanceName == NULL ? "" : instanceName, "fmi2Instantiate", loggingOn,
               "fmuType = %d is neither fmi2ModelExchange nor fmi2CoSimulation.", (int)fmuType);
    }
    return instantiate("fmi2Instantiate", functions, instanceName, fmuGUID, (interface_type)fmuType,
                       loggingOn != fmi2False);
}

FMI2_Export void fmi2FreeInstance(fmi2Component c)
{
    free(c);
}

FMI2_Export fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                                           const fmi2String categories[])
{
    OPEN(fmi2SetDebugLogging, MAY_LOG);
    return (fmi2Status)choose_logs(f, loggingOn != fmi2False, nCategories, categories);
}

/* ---- Initialization, termination, reset ---- */

FMI2_Export fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                                           fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    OPEN(fmi2SetupExperiment, MAY_SET_UP);
    (void)toleranceDefined; /* the step is exact */
    (void)tolerance;
    return (fmi2Status)set_up(f, startTime, stopTimeDefined != fmi2False, stopTime);
}

FMI2_Export fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    OPEN(fmi2EnterInitializationMode, MAY_SET_UP);
    return (fmi2Status)initialize(f);
}

FMI2_Export fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    OPEN(fmi2ExitInitializationMode, MAY_BEGIN);
    return (fmi2Status)run(f);
}

FMI2_Export fmi2Status fmi2Terminate(fmi2Component c)
{
    OPEN(fmi2Terminate, MAY_END);
    return (fmi2Status)terminate(f);
}

FMI2_Export fmi2Status fmi2Reset(fmi2Component c)
{
    OPEN(fmi2Reset, MAY_RESET);
    return (fmi2Status)reset(f);
}

/* ---- Getting and setting values ---- */

FMI2_Export fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    OPEN(fmi2GetReal, MAY_READ);
    return (fmi2Status)get_values(f, vr, nvr, value);
}

FMI2_Export fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[])
{
    OPEN(fmi2SetReal, MAY_WRITE);
    return (fmi2Status)set_values(f, vr, nvr, value);
}

#define NO_VARIABLES(function, type, values, modes)                                                             \
    FMI2_Export fmi2Status function(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, values value[]) \
    {                                                                                                           \
        OPEN(function, modes);                                                                                  \
        (void)vr;                                                                                               \
        (void)value;                                                                                            \
        return (fmi2Status)check_none(f, nvr, type);                                                            \
    }

NO_VARIABLES(fmi2GetInteger, "Integer", fmi2Integer, MAY_READ_LATER)
NO_VARIABLES(fmi2GetBoolean, "Boolean", fmi2Boolean, MAY_READ_LATER)
NO_VARIABLES(fmi2GetString, "String", fmi2String, MAY_READ_LATER)
NO_VARIABLES(fmi2SetInteger, "Integer", const fmi2Integer, MAY_WRITE_DISCRETE)
NO_VARIABLES(fmi2SetBoolean, "Boolean", const fmi2Boolean, MAY_WRITE_DISCRETE)
NO_VARIABLES(fmi2SetString, "String", const fmi2String, MAY_WRITE_DISCRETE)

FMI2_Export fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[],
                                                    size_t nUnknown, const fmi2ValueReference vKnown_ref[],
                                                    size_t nKnown, const fmi2Real dvKnown[], fmi2Real dvUnknown[])
{
    OPEN(fmi2GetDirectionalDerivative, MAY_DIFFERENTIATE);
    return (fmi2Status)differentiate(f, vUnknown_ref, nUnknown, vKnown_ref, nKnown, dvKnown, nKnown, dvUnknown,
                                     nUnknown);
}

/* ---- States ---- */

FMI2_Export fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    OPEN(fmi2GetFMUstate, MAY_SAVE);
    return (fmi2Status)save(f, FMUstate);
}

FMI2_Export fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate)
{
    OPEN(fmi2SetFMUstate, MAY_SAVE);
    return (fmi2Status)restore(f, FMUstate);
}

FMI2_Export fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    OPEN(fmi2FreeFMUstate, MAY_SAVE);
    return (fmi2Status)free_saved(f, FMUstate);
}

FMI2_Export fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size)
{
    OPEN(fmi2SerializedFMUstateSize, MAY_SAVE);
    return (fmi2Status)serialized_size(f, FMUstate, size);
}

FMI2_Export fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[],
                                             size_t size)
{
    OPEN(fmi2SerializeFMUstate, MAY_SAVE);
    return (fmi2Status)serialize(f, FMUstate, (unsigned char *)serializedState, size);
}

FMI2_Export fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                               fmi2FMUstate *FMUstate)
{
    OPEN(fmi2DeSerializeFMUstate, MAY_SAVE);
    return (fmi2Status)deserialize(f, (const unsigned char *)serializedState, size, FMUstate);
}
