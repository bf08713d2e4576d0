/* Names for the functions of both versions of FMI, to include after fmu.c: FMI(Reset) is fmi2Reset or fmi3Reset. When the
 * names differ, FMI() takes the name of FMI 2.0. */
#pragma once

#define PASTE_(a, b) a##b
#define PASTE(a, b) PASTE_(a, b)
#define FMI(name) PASTE(PASTE(fmi, FMI_VERSION), name)
#if FMI_VERSION == 3
#define GetReal GetFloat64
#define SetReal SetFloat64
#define GetFMUstate GetFMUState
#define SetFMUstate SetFMUState
#define FreeFMUstate FreeFMUState
#define SerializedFMUstateSize SerializedFMUStateSize
#define SerializeFMUstate SerializeFMUState
#define DeSerializeFMUstate DeserializeFMUState
#define GetDerivatives GetContinuousStateDerivatives
#define GetRealOutputDerivatives GetOutputDerivatives
#define AND(...) , __VA_ARGS__ /* arguments that only FMI 3.0 has */
#else
#define AND(...)
#endif

typedef FMI(Status) result;
typedef FMI(Boolean) boolean;
typedef FMI(Byte) octet;
