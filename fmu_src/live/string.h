/* The part of <string.h> that the model needs, without a library. */
#ifndef STRING_H
#define STRING_H

#define memcpy(to, from, size) __builtin_memcpy(to, from, size)
#define memset(to, byte, size) __builtin_memset(to, byte, size)

#endif
