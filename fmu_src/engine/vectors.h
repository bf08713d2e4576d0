/* As many lanes (real.h) as the widest vectors of this processor have. */
#if defined __AVX512F__
#define LANES 8
#elif defined __AVX__
#define LANES 4
#else
#define LANES 2
#endif
