/* The one file to compile: everything but the FMI functions stays internal to it.
 *
 * The functions are named <modelIdentifier>_fmi2... where the fmi2Functions.h in use heeds FMI2_FUNCTION_PREFIX, as the
 * standard's own does: several such FMUs can be linked into one program. For a shared library, with plain names, define
 * FMI2_OVERRIDE_FUNCTION_PREFIX. */
#include "interface.h"

#include "riccati.c"
#include "rov.c"

#include "fmi2_common.c"
#include "fmi2_state.c"
#include "fmi2_model_exchange.c"
#include "fmi2_co_simulation.c"
