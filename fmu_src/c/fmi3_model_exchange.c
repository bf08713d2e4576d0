/* Model Exchange (FMI 3.0, section 3). */

FMI3_Export fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance)
{
    OPEN_FOR(TYPE_MODEL_EXCHANGE, fmi3EnterContinuousTimeMode, MAY_UPDATE);
    return (fmi3Status)leave_events(f);
}

FMI3_Export fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                                   fmi3Boolean *enterEventMode, fmi3Boolean *terminateSimulation)
{
    OPEN(fmi3CompletedIntegratorStep, MAY_INTEGRATE);
    (void)noSetFMUStatePriorToCurrentPoint;
    GIVEN(enterEventMode != NULL && terminateSimulation != NULL, "enterEventMode or terminateSimulation");
    bool event;
    const outcome completed = complete_step(f, &event);
    if (completed == DONE) {
        *enterEventMode = event;
        *terminateSimulation = false;
    }
    return (fmi3Status)completed;
}

FMI3_Export fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time)
{
    OPEN_FOR(TYPE_MODEL_EXCHANGE, fmi3SetTime, MAY_MOVE_TIME);
    return (fmi3Status)set_time(f, time);
}

FMI3_Export fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 continuousStates[],
                                               size_t nContinuousStates)
{
    OPEN(fmi3SetContinuousStates, MAY_INTEGRATE);
    return (fmi3Status)set_states(f, continuousStates, nContinuousStates);
}

FMI3_Export fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 derivatives[],
                                                         size_t nContinuousStates)
{
    OPEN_FOR(TYPE_MODEL_EXCHANGE, fmi3GetContinuousStateDerivatives, MAY_READ_LATER);
    return (fmi3Status)get_rates(f, derivatives, nContinuousStates);
}

FMI3_Export fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 eventIndicators[],
                                              size_t nEventIndicators)
{
    OPEN_FOR(TYPE_MODEL_EXCHANGE, fmi3GetEventIndicators, MAY_READ_LATER);
    (void)eventIndicators;
    return (fmi3Status)get_indicators(f, nEventIndicators);
}

FMI3_Export fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 continuousStates[],
                                               size_t nContinuousStates)
{
    OPEN_FOR(TYPE_MODEL_EXCHANGE, fmi3GetContinuousStates, MAY_READ_LATER);
    return (fmi3Status)get_states(f, continuousStates, nContinuousStates);
}

FMI3_Export fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[],
                                                         size_t nContinuousStates)
{
    OPEN_FOR(TYPE_MODEL_EXCHANGE, fmi3GetNominalsOfContinuousStates, MAY_READ_LATER);
    return (fmi3Status)get_nominals(f, nominals, nContinuousStates);
}

/* How many of something the model has. */
#define COUNT(function, name, number)                                    \
    FMI3_Export fmi3Status function(fmi3Instance instance, size_t *name) \
    {                                                                    \
        OPEN_FOR(TYPE_MODEL_EXCHANGE, function, MAY_COUNT);              \
        GIVEN(name != NULL, #name);                                      \
        *name = number;                                                  \
        warn_in(f, CONTINUOUS, COUNTED_LATE);                            \
        return fmi3OK;                                                   \
    }

COUNT(fmi3GetNumberOfEventIndicators, nEventIndicators, 0)
COUNT(fmi3GetNumberOfContinuousStates, nContinuousStates, N_STATES)
