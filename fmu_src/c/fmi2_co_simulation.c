/* Co-Simulation (FMI 2.0, section 4.2). */

static outcome check_no_derivatives(fmu *f, size_t n)
{
    REQUIRE(n == 0, "inputs are held over a step (canInterpolateInputs = false).");
    return DONE;
}

FMI2_Export fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                                   const fmi2Integer order[], const fmi2Real value[])
{
    OPEN_FOR(TYPE_CO_SIMULATION, fmi2SetRealInputDerivatives, MAY_WRITE_DISCRETE);
    (void)vr;
    (void)order;
    (void)value;
    return (fmi2Status)check_no_derivatives(f, nvr);
}

FMI2_Export fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                                    const fmi2Integer order[], fmi2Real value[])
{
    OPEN_FOR(TYPE_CO_SIMULATION, fmi2GetRealOutputDerivatives, MAY_ASK_OUTPUTS);
    return (fmi2Status)get_output_rates(f, vr, nvr, order, value);
}

FMI2_Export fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint,
                                  fmi2Real communicationStepSize, fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    OPEN(fmi2DoStep, MAY_STEP);
    (void)noSetFMUStatePriorToCurrentPoint;
    return (fmi2Status)step(f, currentCommunicationPoint, communicationStepSize);
}

static outcome refuse_to_cancel(fmu *f)
{
    FAIL(f, "no step is pending.");
}

FMI2_Export fmi2Status fmi2CancelStep(fmi2Component c)
{
    OPEN(fmi2CancelStep, MAY_LOG);
    return (fmi2Status)refuse_to_cancel(f);
}

static outcome discard_status(fmu *f, int kind)
{
    DISCARD(f, "status kind %d is not available, steps are never pending.", kind);
}

/* The functions fmi2Get<Type>Status. Steps are never pending, so most kinds of status do not exist. */
#define STATUS(function, type, exists, answer)                                            \
    FMI2_Export fmi2Status function(fmi2Component c, const fmi2StatusKind s, type *value) \
    {                                                                                     \
        OPEN_FOR(TYPE_CO_SIMULATION, function, MAY_ASK_STATUS);                           \
        GIVEN(value != NULL, "value");                                                    \
        if (!(exists)) {                                                                  \
            return (fmi2Status)discard_status(f, (int)s);                                 \
        }                                                                                 \
        *value = answer;                                                                  \
        return fmi2OK;                                                                    \
    }

STATUS(fmi2GetStatus, fmi2Status, false, fmi2OK)
STATUS(fmi2GetRealStatus, fmi2Real, s == fmi2LastSuccessfulTime, f->now.time)
STATUS(fmi2GetIntegerStatus, fmi2Integer, false, 0)
STATUS(fmi2GetBooleanStatus, fmi2Boolean, s == fmi2Terminated, fmi2False)
STATUS(fmi2GetStringStatus, fmi2String, false, NULL)
