/* Co-Simulation (FMI 3.0, section 4), and the one function of Scheduled Execution that a library must have. */

FMI3_Export fmi3Status fmi3EnterStepMode(fmi3Instance instance)
{
    OPEN_FOR(TYPE_CO_SIMULATION, fmi3EnterStepMode, MAY_UPDATE);
    return (fmi3Status)enter(f, STEP);
}

FMI3_Export fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                                size_t nValueReferences, const fmi3Int32 orders[], fmi3Float64 values[],
                                                size_t nValues)
{
    OPEN_FOR(TYPE_CO_SIMULATION, fmi3GetOutputDerivatives, MAY_ASK_OUTPUTS);
    const outcome counted = check_count(f, nValueReferences, nValues);
    return (fmi3Status)(counted == DONE ? get_output_rates(f, valueReferences, nValueReferences, orders, values) : counted);
}

/* The time between two intermediate updates, s. Inputs are held for this time. It is longer when a step would otherwise have
 * more than MOST_UPDATES updates. */
static const double UPDATE_INTERVAL = 1e-4;
enum { MOST_UPDATES = 10000 };

/* Call the callback of intermediate update at the current state, `gone` seconds after t. The callback may read
 * variables and set inputs. If it ends the step early, *length becomes shorter. */
static void update(fmu *f, double t, double gone, double *length, bool is_inside)
{
    const char *const function = f->function;
    const bool may_return = is_inside && f->host.may_return_early;
    fmi3Boolean early = false;
    const double end = t + *length;
    fmi3Float64 wanted = end;
    f->now.mode = INTERMEDIATE;
    f->host.update(f->host.environment, f->now.time, true, true, true, may_return, &early, &wanted);
    f->now.mode = STEP;
    f->function = function;
    if (early && may_return && wanted < end) {
        *length = fmax(wanted - t, gone);
    }
}

/* Step with intermediate updates. The inputs of an update are held until the next one. *last becomes the time at which the step
 * ends. */
static outcome step_with_updates(fmu *f, double t, double h, double *last)
{
    const double updates = fmin(fmax(1.0, ceil(h / UPDATE_INTERVAL * (1.0 - 1e-9))), MOST_UPDATES);
    int cuts = 0;
    double length = h, gone = 0.0; /* measured from t, because an interval may be smaller than the rounding of a large t */
    TRY(check_step(f, t, h));
    follow_jump(f, f->now.time, t, h);
    f->now.time = t;
    update(f, t, gone, &length, false);
    for (double n = 1.0; gone < length; n++) {
        const double from = gone;
        gone = n < updates ? fmin(length, h * (n / updates)) : length;
        TRY(advance(f, t + from, gone - from, &cuts));
        f->now.time = *last = t + gone; /* without the rounding of a sum over intervals */
        update(f, t, gone, &length, gone < length);
    }
    return DONE;
}

FMI3_Export fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint,
                                  fmi3Float64 communicationStepSize, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                  fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                                  fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    OPEN(fmi3DoStep, MAY_STEP);
    (void)noSetFMUStatePriorToCurrentPoint;
    GIVEN(eventHandlingNeeded != NULL && terminateSimulation != NULL && earlyReturn != NULL && lastSuccessfulTime != NULL,
          "one of the results");
    *eventHandlingNeeded = *terminateSimulation = *earlyReturn = false;
    if (f->host.update == NULL) {
        const fmi3Status done = (fmi3Status)step(f, currentCommunicationPoint, communicationStepSize);
        *lastSuccessfulTime = done == fmi3OK ? f->now.time : currentCommunicationPoint;
        return done;
    }
    *lastSuccessfulTime = currentCommunicationPoint;
    const outcome done = step_with_updates(f, currentCommunicationPoint, communicationStepSize, lastSuccessfulTime);
    *earlyReturn = done == DONE && *lastSuccessfulTime < currentCommunicationPoint + communicationStepSize;
    return (fmi3Status)done;
}

FMI3_Export fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clockReference,
                                                  fmi3Float64 activationTime)
{
    OPEN(fmi3ActivateModelPartition, MAY_LOG);
    (void)clockReference;
    (void)activationTime;
    return (fmi3Status)refuse_missing(f, "Scheduled Execution");
}
