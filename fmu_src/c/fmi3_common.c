/* Creation, initialization, values, partial derivatives and states (FMI 3.0, section 2.2). */

FMI3_Export const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

FMI3_Export fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories,
                                           const fmi3String categories[])
{
    OPEN(fmi3SetDebugLogging, MAY_LOG);
    return (fmi3Status)choose_logs(f, loggingOn, nCategories, categories);
}

FMI3_Export fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                                      fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                                      fmi3InstanceEnvironment instanceEnvironment,
                                                      fmi3LogMessageCallback logMessage)
{
    const host callbacks = {instanceEnvironment, logMessage, NULL, false, false};
    (void)resourcePath; /* everything is in the binary, whatever the path says */
    (void)visible;
    return instantiate("fmi3InstantiateModelExchange", &callbacks, instanceName, instantiationToken, TYPE_MODEL_EXCHANGE,
                       loggingOn);
}

FMI3_Export fmi3Instance fmi3InstantiateCoSimulation(fmi3String instanceName, fmi3String instantiationToken,
                                                     fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                                     fmi3Boolean eventModeUsed, fmi3Boolean earlyReturnAllowed,
                                                     const fmi3ValueReference requiredIntermediateVariables[],
                                                     size_t nRequiredIntermediateVariables,
                                                     fmi3InstanceEnvironment instanceEnvironment,
                                                     fmi3LogMessageCallback logMessage,
                                                     fmi3IntermediateUpdateCallback intermediateUpdate)
{
    const bool wanted = nRequiredIntermediateVariables > 0 || earlyReturnAllowed;
    const host callbacks = {instanceEnvironment, logMessage, wanted ? intermediateUpdate : NULL, eventModeUsed,
                            earlyReturnAllowed};
    const char *const function = "fmi3InstantiateCoSimulation";
    (void)resourcePath;
    (void)visible;
    for (size_t i = 0; i < nRequiredIntermediateVariables; i++) {
        if (requiredIntermediateVariables == NULL || place_of(requiredIntermediateVariables[i]) > TIME) {
            REJECT(&callbacks, instanceName, function, loggingOn,
                   "requiredIntermediateVariables is NULL or has a value reference of no variable.");
        }
    }
    return instantiate(function, &callbacks, instanceName, instantiationToken, TYPE_CO_SIMULATION, loggingOn);
}

FMI3_Export fmi3Instance fmi3InstantiateScheduledExecution(fmi3String instanceName, fmi3String instantiationToken,
                                                           fmi3String resourcePath, fmi3Boolean visible,
                                                           fmi3Boolean loggingOn,
                                                           fmi3InstanceEnvironment instanceEnvironment,
                                                           fmi3LogMessageCallback logMessage,
                                                           fmi3ClockUpdateCallback clockUpdate,
                                                           fmi3LockPreemptionCallback lockPreemption,
                                                           fmi3UnlockPreemptionCallback unlockPreemption)
{
    const host callbacks = {instanceEnvironment, logMessage, NULL, false, false};
    (void)instantiationToken;
    (void)resourcePath;
    (void)visible;
    (void)clockUpdate;
    (void)lockPreemption;
    (void)unlockPreemption;
    REJECT(&callbacks, instanceName, "fmi3InstantiateScheduledExecution", loggingOn, "this FMU has no Scheduled Execution.");
}

FMI3_Export void fmi3FreeInstance(fmi3Instance instance)
{
    free(instance);
}

/* ---- Initialization, termination, reset ---- */

FMI3_Export fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined,
                                                   fmi3Float64 tolerance, fmi3Float64 startTime,
                                                   fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    OPEN(fmi3EnterInitializationMode, MAY_SET_UP);
    (void)toleranceDefined; /* the step is exact */
    (void)tolerance;
    const outcome done = set_up(f, startTime, stopTimeDefined, stopTime);
    return (fmi3Status)(done == DONE ? initialize(f) : done);
}

FMI3_Export fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    OPEN(fmi3ExitInitializationMode, MAY_BEGIN);
    return (fmi3Status)run(f);
}

/* The functions of Configuration Mode, in which only structural parameters may be set. The FMU has none. */
#define NO_CONFIGURATION(function)                                     \
    FMI3_Export fmi3Status function(fmi3Instance instance)             \
    {                                                                  \
        OPEN(function, MAY_LOG);                                       \
        return (fmi3Status)refuse_missing(f, "structural parameters"); \
    }

static outcome refuse_missing(fmu *f, const char *what)
{
    FAIL(f, "this FMU has no %s.", what);
}

static outcome refuse_events(fmu *f)
{
    FAIL(f, "this instance has no Event Mode, because it was instantiated with eventModeUsed = false.");
}

NO_CONFIGURATION(fmi3EnterConfigurationMode)
NO_CONFIGURATION(fmi3ExitConfigurationMode)

FMI3_Export fmi3Status fmi3Terminate(fmi3Instance instance)
{
    OPEN(fmi3Terminate, MAY_END);
    return (fmi3Status)terminate(f);
}

FMI3_Export fmi3Status fmi3Reset(fmi3Instance instance)
{
    OPEN(fmi3Reset, MAY_RESET);
    return (fmi3Status)reset(f);
}

/* ---- Event Mode ---- */

FMI3_Export fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    OPEN(fmi3EnterEventMode, MAY_MEET_EVENTS);
    if (f->now.mode == STEP && !f->host.uses_events) {
        return (fmi3Status)refuse_events(f);
    }
    warn_in(f, EVENT, EVENT_ENTERED_AGAIN);
    return (fmi3Status)enter_events(f);
}

FMI3_Export fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance)
{
    OPEN(fmi3EvaluateDiscreteStates, MAY_UPDATE);
    return fmi3OK; /* there are none */
}

/* The only events of the model are changes of commands that arrive after the dead time. */
FMI3_Export fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate,
                                                fmi3Boolean *terminateSimulation,
                                                fmi3Boolean *nominalsOfContinuousStatesChanged,
                                                fmi3Boolean *valuesOfContinuousStatesChanged,
                                                fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime)
{
    OPEN(fmi3UpdateDiscreteStates, MAY_UPDATE);
    GIVEN(discreteStatesNeedUpdate != NULL && terminateSimulation != NULL && nominalsOfContinuousStatesChanged != NULL
              && valuesOfContinuousStatesChanged != NULL && nextEventTimeDefined != NULL && nextEventTime != NULL,
          "one of the results");
    *discreteStatesNeedUpdate = *terminateSimulation = *nominalsOfContinuousStatesChanged = false;
    *valuesOfContinuousStatesChanged = false;
    return (fmi3Status)update_discrete(f, nextEventTimeDefined, nextEventTime);
}

/* ---- Getting and setting values ---- */

static outcome check_count(fmu *f, size_t references, size_t values)
{
    REQUIRE(references == values, "%zu value references and %zu values, though every variable is a scalar.", references,
            values);
    return DONE;
}

FMI3_Export fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                      size_t nValueReferences, fmi3Float64 values[], size_t nValues)
{
    OPEN(fmi3GetFloat64, MAY_READ);
    const outcome counted = check_count(f, nValueReferences, nValues);
    return (fmi3Status)(counted == DONE ? get_values(f, valueReferences, nValueReferences, values) : counted);
}

FMI3_Export fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                      size_t nValueReferences, const fmi3Float64 values[], size_t nValues)
{
    OPEN(fmi3SetFloat64, MAY_WRITE);
    const outcome counted = check_count(f, nValueReferences, nValues);
    return (fmi3Status)(counted == DONE ? set_values(f, valueReferences, nValueReferences, values) : counted);
}

/* Functions for variables that the FMU does not have. A call for none of them is legal. */
#define NONE_OF(what, function, modes, count, unused, ...)              \
    FMI3_Export fmi3Status function(fmi3Instance instance, __VA_ARGS__) \
    {                                                                   \
        OPEN(function, modes);                                          \
        unused;                                                         \
        return (fmi3Status)check_none(f, count, what);                  \
    }
#define NO_VARIABLES(type, may_write)                                                                                     \
    NONE_OF(#type, fmi3Get##type, MAY_READ_LATER, nValueReferences, ((void)valueReferences, (void)values, (void)nValues), \
            const fmi3ValueReference valueReferences[], size_t nValueReferences, fmi3##type values[], size_t nValues)     \
    NONE_OF(#type, fmi3Set##type, may_write, nValueReferences,                                                            \
            ((void)valueReferences, (void)values, (void)nValues), const fmi3ValueReference valueReferences[],             \
            size_t nValueReferences, const fmi3##type values[], size_t nValues)

NO_VARIABLES(Float32, MAY_WRITE)
NO_VARIABLES(Int8, MAY_WRITE_DISCRETE)
NO_VARIABLES(UInt8, MAY_WRITE_DISCRETE)
NO_VARIABLES(Int16, MAY_WRITE_DISCRETE)
NO_VARIABLES(UInt16, MAY_WRITE_DISCRETE)
NO_VARIABLES(Int32, MAY_WRITE_DISCRETE)
NO_VARIABLES(UInt32, MAY_WRITE_DISCRETE)
NO_VARIABLES(Int64, MAY_WRITE_DISCRETE)
NO_VARIABLES(UInt64, MAY_WRITE_DISCRETE)
NO_VARIABLES(Boolean, MAY_WRITE_DISCRETE)
NO_VARIABLES(String, MAY_WRITE_DISCRETE)
NONE_OF("Binary", fmi3GetBinary, MAY_READ_LATER, nValueReferences,
        ((void)valueReferences, (void)valueSizes, (void)values, (void)nValues), const fmi3ValueReference valueReferences[],
        size_t nValueReferences, size_t valueSizes[], fmi3Binary values[], size_t nValues)
NONE_OF("Binary", fmi3SetBinary, MAY_WRITE_DISCRETE, nValueReferences,
        ((void)valueReferences, (void)valueSizes, (void)values, (void)nValues), const fmi3ValueReference valueReferences[],
        size_t nValueReferences, const size_t valueSizes[], const fmi3Binary values[], size_t nValues)

/* Functions for clocks, which the FMU does not have. */
#define NO_CLOCKS(function, modes, unused, ...)                                                                       \
    NONE_OF("Clock", function, modes, nValueReferences, ((void)valueReferences, unused),                              \
            const fmi3ValueReference valueReferences[], size_t nValueReferences, __VA_ARGS__)

NO_CLOCKS(fmi3GetClock, MAY_UPDATE | INITIALIZATION, (void)values, fmi3Clock values[])
NO_CLOCKS(fmi3SetClock, MAY_UPDATE | INITIALIZATION, (void)values, const fmi3Clock values[])
NO_CLOCKS(fmi3GetIntervalDecimal, MAY_UPDATE | INITIALIZATION, ((void)intervals, (void)qualifiers), fmi3Float64 intervals[],
          fmi3IntervalQualifier qualifiers[])
NO_CLOCKS(fmi3GetIntervalFraction, MAY_UPDATE | INITIALIZATION, ((void)counters, (void)resolutions, (void)qualifiers),
          fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
NO_CLOCKS(fmi3GetShiftDecimal, INITIALIZATION, (void)shifts, fmi3Float64 shifts[])
NO_CLOCKS(fmi3GetShiftFraction, INITIALIZATION, ((void)counters, (void)resolutions), fmi3UInt64 counters[],
          fmi3UInt64 resolutions[])
NO_CLOCKS(fmi3SetIntervalDecimal, MAY_UPDATE | INITIALIZATION, (void)intervals, const fmi3Float64 intervals[])
NO_CLOCKS(fmi3SetIntervalFraction, MAY_UPDATE | INITIALIZATION, ((void)counters, (void)resolutions),
          const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
NO_CLOCKS(fmi3SetShiftDecimal, INITIALIZATION, (void)shifts, const fmi3Float64 shifts[])
NO_CLOCKS(fmi3SetShiftFraction, INITIALIZATION, ((void)counters, (void)resolutions), const fmi3UInt64 counters[],
          const fmi3UInt64 resolutions[])

/* ---- Partial derivatives ---- */

FMI3_Export fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                                    size_t nUnknowns, const fmi3ValueReference knowns[], size_t nKnowns,
                                                    const fmi3Float64 seed[], size_t nSeed, fmi3Float64 sensitivity[],
                                                    size_t nSensitivity)
{
    OPEN(fmi3GetDirectionalDerivative, MAY_DIFFERENTIATE);
    return (fmi3Status)differentiate(f, unknowns, nUnknowns, knowns, nKnowns, seed, nSeed, sensitivity, nSensitivity);
}

/* Compute sensitivity = seed J, one column after the other. A tangent is so cheap that a reverse mode is not worth its code. */
static outcome differentiate_adjoint(fmu *f, const unsigned unknowns[], size_t n_unknowns, const unsigned knowns[],
                                     size_t n_knowns, const double seed[], size_t n_seed, double sensitivity[],
                                     size_t n_sensitivity)
{
    TRY(check_partial(f, unknowns, n_unknowns, knowns, n_knowns, seed, n_seed, sensitivity, n_sensitivity, true));
    for (int pass = 0; pass < 2; pass++) { /* results are written only after all of them have been found finite */
        for (size_t k = 0; k < n_knowns; k++) {
            double d[N_VARIABLES] = {0.0}, sum = 0.0;
            d[place_of(knowns[k])] = 1.0;
            add_changes(f, d);
            for (size_t i = 0; i < n_unknowns; i++) {
                sum += seed[i] * d[place_of(unknowns[i])];
            }
            REQUIRE(isfinite(sum), "the derivative of %s is not a finite number.", name_of(knowns[k]));
            if (pass == 1) {
                sensitivity[k] = sum;
            }
        }
    }
    return DONE;
}

FMI3_Export fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                                size_t nUnknowns, const fmi3ValueReference knowns[], size_t nKnowns,
                                                const fmi3Float64 seed[], size_t nSeed, fmi3Float64 sensitivity[],
                                                size_t nSensitivity)
{
    OPEN(fmi3GetAdjointDerivative, MAY_DIFFERENTIATE);
    return (fmi3Status)differentiate_adjoint(f, unknowns, nUnknowns, knowns, nKnowns, seed, nSeed, sensitivity,
                                             nSensitivity);
}

/* All variables are scalars, so modelDescription.xml lists all dependencies (providesPerElementDependencies is not
 * declared). */
FMI3_Export fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference valueReference,
                                                           size_t *nDependencies)
{
    OPEN(fmi3GetNumberOfVariableDependencies, MAY_LOG);
    (void)valueReference;
    (void)nDependencies;
    return (fmi3Status)refuse_missing(f, "dependencies by element");
}

FMI3_Export fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent,
                                                   size_t elementIndicesOfDependent[], fmi3ValueReference independents[],
                                                   size_t elementIndicesOfIndependents[],
                                                   fmi3DependencyKind dependencyKinds[], size_t nDependencies)
{
    OPEN(fmi3GetVariableDependencies, MAY_LOG);
    (void)dependent;
    (void)elementIndicesOfDependent;
    (void)independents;
    (void)elementIndicesOfIndependents;
    (void)dependencyKinds;
    (void)nDependencies;
    return (fmi3Status)refuse_missing(f, "dependencies by element");
}

/* ---- States ---- */

FMI3_Export fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    OPEN(fmi3GetFMUState, MAY_SAVE);
    return (fmi3Status)save(f, FMUState);
}

FMI3_Export fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState)
{
    OPEN(fmi3SetFMUState, MAY_SAVE);
    return (fmi3Status)restore(f, FMUState);
}

FMI3_Export fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    OPEN(fmi3FreeFMUState, MAY_SAVE);
    return (fmi3Status)free_saved(f, FMUState);
}

FMI3_Export fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size)
{
    OPEN(fmi3SerializedFMUStateSize, MAY_SAVE);
    return (fmi3Status)serialized_size(f, FMUState, size);
}

FMI3_Export fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState, fmi3Byte serializedState[],
                                             size_t size)
{
    OPEN(fmi3SerializeFMUState, MAY_SAVE);
    return (fmi3Status)serialize(f, FMUState, serializedState, size);
}

FMI3_Export fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[], size_t size,
                                               fmi3FMUState *FMUState)
{
    OPEN(fmi3DeserializeFMUState, MAY_SAVE);
    return (fmi3Status)deserialize(f, serializedState, size, FMUState);
}
