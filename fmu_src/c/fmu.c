/* The one file to compile: everything but the FMI functions stays internal to it. */

/* Importers compile for processors that multiply and add with one rounding; the results are those of two. */
#if defined __GNUC__ && !defined __clang__
#pragma GCC optimize("fp-contract=off", "no-tree-slp-vectorize") /* which in GCC 12 contracts all the same */
#elif defined _MSC_VER && !defined __clang__
#pragma fp_contract(off)
#else
#pragma STDC FP_CONTRACT OFF
#endif

#include "interface.h"

/* The functions are named <modelIdentifier>_fmi2..., so that several FMUs can be linked into one program; plainly, as in
 * a shared library, where FMI2_OVERRIDE_FUNCTION_PREFIX is defined. The headers before FMI 2.0.4 do not know it: with
 * them names are plain unless FMI2_FUNCTION_PREFIX is defined for the compiler. */
#if !defined FMI2_FUNCTION_PREFIX && !defined FMI2_OVERRIDE_FUNCTION_PREFIX
#define FMI2_FUNCTION_PREFIX MODEL_PREFIX
#include "fmi2Functions.h"
#ifndef FMI2_ACTUAL_FUNCTION_PREFIX /* which those of 2.0.4 define; the older ones are included again without prefix */
#undef FMI2_FUNCTION_PREFIX
#undef FMI2_Export
#undef fmi2FullName
#undef fmi2Functions_h
#endif
#endif
#include "fmi2Functions.h"

#include "riccati.c"
#include "rov.c"
#include "track.c"
#include "series.c"
#include "rov_step.c"

#include "fmi2_common.c"
#include "fmi2_state.c"
#include "fmi2_model_exchange.c"
#include "fmi2_co_simulation.c"
