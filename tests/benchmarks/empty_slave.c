/* A native slave that does nothing: what the interface itself costs an importer. Its functions leave their arguments
   where the caller has put them, which the calling conventions of linux64, win64 and aarch64 allow. */
#include <stddef.h>

#include "variables.h"

#define NOTHING(name)         \
    EXPORTED int fmi2##name(void); \
    int fmi2##name(void)      \
    {                         \
        return 0;             \
    }

EXPORTED const char *fmi2GetTypesPlatform(void);
EXPORTED const char *fmi2GetVersion(void);
EXPORTED void *fmi2Instantiate(void);

const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

const char *fmi2GetVersion(void)
{
    return "2.0";
}

void *fmi2Instantiate(void)
{
    static double nothing;
    return &nothing;
}

NOTHING(FreeInstance)
NOTHING(SetDebugLogging)
NOTHING(SetupExperiment)
NOTHING(EnterInitializationMode)
NOTHING(ExitInitializationMode)
NOTHING(Terminate)
NOTHING(Reset)
NOTHING(GetReal)
NOTHING(GetInteger)
NOTHING(GetBoolean)
NOTHING(GetString)
NOTHING(SetReal)
NOTHING(SetInteger)
NOTHING(SetBoolean)
NOTHING(SetString)
NOTHING(GetFMUstate)
NOTHING(SetFMUstate)
NOTHING(FreeFMUstate)
NOTHING(SerializedFMUstateSize)
NOTHING(SerializeFMUstate)
NOTHING(DeSerializeFMUstate)
NOTHING(GetDirectionalDerivative)
NOTHING(SetRealInputDerivatives)
NOTHING(GetRealOutputDerivatives)
NOTHING(DoStep)
NOTHING(CancelStep)
NOTHING(GetStatus)
NOTHING(GetRealStatus)
NOTHING(GetIntegerStatus)
NOTHING(GetBooleanStatus)
NOTHING(GetStringStatus)
