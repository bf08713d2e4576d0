/* Model Exchange (FMI 2.0, section 3.2). */

FMI2_Export fmi2Status fmi2EnterEventMode(fmi2Component c)
{
    OPEN_FOR(TYPE_MODEL_EXCHANGE, fmi2EnterEventMode, MAY_MEET_EVENTS);
    return (fmi2Status)enter_events(f);
}

FMI2_Export fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *fmi2eventInfo)
{
    OPEN(fmi2NewDiscreteStates, MAY_UPDATE);
    GIVEN(fmi2eventInfo != NULL, "eventInfo");
    bool has_next = false;
    memset(fmi2eventInfo, 0, sizeof *fmi2eventInfo); /* the only events of the model are commands after a dead time */
    const outcome done = update_discrete(f, &has_next, &fmi2eventInfo->nextEventTime);
    fmi2eventInfo->nextEventTimeDefined = has_next ? fmi2True : fmi2False;
    return (fmi2Status)done;
}

FMI2_Export fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c)
{
    OPEN_FOR(TYPE_MODEL_EXCHANGE, fmi2EnterContinuousTimeMode, MAY_UPDATE);
    return (fmi2Status)leave_events(f);
}

FMI2_Export fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                                   fmi2Boolean *enterEventMode, fmi2Boolean *terminateSimulation)
{
    OPEN(fmi2CompletedIntegratorStep, MAY_INTEGRATE);
    (void)noSetFMUStatePriorToCurrentPoint;
    GIVEN(enterEventMode != NULL && terminateSimulation != NULL, "enterEventMode or terminateSimulation");
    bool event;
    const outcome completed = complete_step(f, &event);
    if (completed == DONE) {
        *enterEventMode = event ? fmi2True : fmi2False;
        *terminateSimulation = fmi2False;
    }
    return (fmi2Status)completed;
}

FMI2_Export fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time)
{
    OPEN_FOR(TYPE_MODEL_EXCHANGE, fmi2SetTime, MAY_MOVE_TIME);
    return (fmi2Status)set_time(f, time);
}

FMI2_Export fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx)
{
    OPEN(fmi2SetContinuousStates, MAY_INTEGRATE);
    return (fmi2Status)set_states(f, x, nx);
}

FMI2_Export fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx)
{
    OPEN_FOR(TYPE_MODEL_EXCHANGE, fmi2GetDerivatives, MAY_READ_LATER);
    return (fmi2Status)get_rates(f, derivatives, nx);
}

FMI2_Export fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real eventIndicators[], size_t ni)
{
    OPEN_FOR(TYPE_MODEL_EXCHANGE, fmi2GetEventIndicators, MAY_READ_LATER);
    (void)eventIndicators;
    return (fmi2Status)get_indicators(f, ni);
}

FMI2_Export fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx)
{
    OPEN_FOR(TYPE_MODEL_EXCHANGE, fmi2GetContinuousStates, MAY_READ_LATER);
    return (fmi2Status)get_states(f, x, nx);
}

FMI2_Export fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x_nominal[], size_t nx)
{
    OPEN_FOR(TYPE_MODEL_EXCHANGE, fmi2GetNominalsOfContinuousStates, MAY_READ);
    return (fmi2Status)get_nominals(f, x_nominal, nx);
}
