// The module is not called DCloth: Unreal would define DCLOTH_API for it, which is a macro of dcloth.h.
#include "Modules/ModuleManager.h"

IMPLEMENT_MODULE(FDefaultModuleImpl, DClothRuntime)
