/* The only file to compile. It includes the others, so that only the FMI functions are visible from outside. */

/* Some processors can multiply and add with a single rounding. The results must not depend on this, so it is switched off. */
#if defined __GNUC__ && !defined __clang__
#pragma GCC optimize("fp-contract=off", "no-tree-slp-vectorize") /* in GCC 12 that vectorizer contracts nevertheless */
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
