// The core that the plugins for Godot and Unreal share, compiled into this module.
#include "CoreMinimal.h"

THIRD_PARTY_INCLUDES_START
#include "garment/garment.cc"
THIRD_PARTY_INCLUDES_END
