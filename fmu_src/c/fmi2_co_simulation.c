/* Co-Simulation (FMI 2.0, section 4.2). */
#include "fmi2_instance.h"

FMI2_Export fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                                   const fmi2Integer order[], const fmi2Real value[])
{
    OPEN("fmi2SetRealInputDerivatives", INSTANTIATED | INITIALIZATION | STEP);
    ONLY_CS("fmi2SetRealInputDerivatives");
    (void)vr;
    (void)order;
    (void)value;
    REQUIRE("fmi2SetRealInputDerivatives", nvr == 0, "inputs are held over a step (canInterpolateInputs = false).");
    return fmi2OK;
}

static bool is_output(fmi2ValueReference vr)
{
    const bool derivative = vr >= FIRST_CALCULATED && vr < FIRST_CALCULATED + N_STATES;
    return vr < N_VARIABLES && !derivative && (VARIABLES[vr].kind == STATE || VARIABLES[vr].kind == CALCULATED);
}

FMI2_Export fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                                    const fmi2Integer order[], fmi2Real value[])
{
    OPEN("fmi2GetRealOutputDerivatives", STEP | TERMINATED | FAILED);
    ONLY_CS("fmi2GetRealOutputDerivatives");
    REQUIRE("fmi2GetRealOutputDerivatives", nvr == 0 || (vr != NULL && order != NULL && value != NULL),
            "vr, order or value is NULL.");
    for (size_t i = 0; i < nvr; i++) {
        REQUIRE("fmi2GetRealOutputDerivatives", is_output(vr[i]), "value reference %u is no output.", vr[i]);
        REQUIRE("fmi2GetRealOutputDerivatives", order[i] == 1, "order %d of %s is not available, only 1.", order[i],
                VARIABLES[vr[i]].name);
    }
    calculate(f);
    double d[N_VARIABLES] = {0.0}; /* commands are held */
    memcpy(&d[FIRST_STATE], &f->now.values[FIRST_CALCULATED], N_STATES * sizeof d[0]);
    rov_tangent(f->now.values, d);
    for (size_t i = 0; i < nvr; i++) {
        const double rate = d[vr[i]];
        REQUIRE("fmi2GetRealOutputDerivatives", isfinite(rate), "the derivative of %s overflows.",
                VARIABLES[vr[i]].name);
        value[i] = rate;
    }
    return fmi2OK;
}

/* Rounding of communication points, relative to their size, but never more than half a step. */
static double time_tolerance(double t, double h)
{
    return fmin(1e-9 * (fabs(t) + h), 0.5 * h);
}

FMI2_Export fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint,
                                  fmi2Real communicationStepSize, fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    OPEN("fmi2DoStep", STEP);
    (void)noSetFMUStatePriorToCurrentPoint;
    const double t = currentCommunicationPoint, h = communicationStepSize, end = t + h;
    REQUIRE("fmi2DoStep", h > 0.0 && isfinite(end), "communicationStepSize = %g at t = %g is not a step forward.", h, t);
    REQUIRE("fmi2DoStep", !f->now.stop_defined || end <= f->now.stop + time_tolerance(f->now.stop, h),
            "a step of %g s from t = %.15g passes stopTime = %.15g.", h, t, f->now.stop);
    double next[N_STATES], sum = 0.0; /* not finite if one is not: zero times it is NaN */
    if (!rov_step(f->now.values, &f->gains, h, next)) {
        f->now.mode = FAILED;
        FAIL(f, "fmi2DoStep: the motion over %g s from t = %g takes more than MOST_PIECES = %d pieces; the state from before "
             "is kept.", h, t, (int)MOST_PIECES);
    }
    for (size_t i = 0; i < N_STATES; i++) {
        sum += 0.0 * next[i];
    }
    if (sum != 0.0) {
        f->now.mode = FAILED;
        FAIL(f, "fmi2DoStep: the motion over %g s from t = %g overflows; the state from before is kept.", h, t);
    }
    memcpy(&f->now.values[FIRST_STATE], next, sizeof next);
    if (fabs(t - f->now.time) > time_tolerance(f->now.time, h)) {
        WARN_ONCE(f, TIME_JUMPED, "fmi2DoStep: the step from t = %.15g does not begin at t = %.15g, where the FMU is; done "
                  "from its state, and said once.", t, f->now.time);
    }
    f->now.time = end; /* the model is autonomous: whatever t says, h seconds have passed */
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2CancelStep(fmi2Component c)
{
    OPEN("fmi2CancelStep", EVERYWHERE);
    FAIL(f, "fmi2CancelStep: no step is pending.");
}

/* fmi2GetXXXStatus: steps are never pending, so most of what can be asked for does not exist. */
#define STATUS(function, type, exists, answer)                                                                       \
    FMI2_Export fmi2Status function(fmi2Component c, const fmi2StatusKind s, type *value)                            \
    {                                                                                                                \
        OPEN(#function, STEP | TERMINATED);                                                                          \
        ONLY_CS(#function);                                                                                          \
        REQUIRE(#function, value != NULL, "value is NULL.");                                                         \
        if (!(exists)) {                                                                                             \
            DISCARD(f, "%s: status kind %d is not available, steps are never pending.", #function, (int)s);          \
        }                                                                                                            \
        *value = answer;                                                                                             \
        return fmi2OK;                                                                                               \
    }

STATUS(fmi2GetStatus, fmi2Status, false, fmi2OK)
STATUS(fmi2GetRealStatus, fmi2Real, s == fmi2LastSuccessfulTime, f->now.time)
STATUS(fmi2GetIntegerStatus, fmi2Integer, false, 0)
STATUS(fmi2GetBooleanStatus, fmi2Boolean, s == fmi2Terminated, fmi2False)
STATUS(fmi2GetStringStatus, fmi2String, false, NULL)
