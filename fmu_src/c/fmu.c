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

#if FMI_VERSION == 3
#include "fmi3_host.h"
#else
#include "fmi2_host.h"
#endif

#include "series.c"
#include "step.c"

#include "instance.h"
#include "instance.c"
#include "saved.c"

#if FMI_VERSION == 3
#include "fmi3_common.c"
#include "fmi3_model_exchange.c"
#include "fmi3_co_simulation.c"
#else
#include "fmi2_common.c"
#include "fmi2_model_exchange.c"
#include "fmi2_co_simulation.c"
#endif
