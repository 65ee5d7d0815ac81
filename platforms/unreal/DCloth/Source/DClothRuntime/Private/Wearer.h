// A character of Unreal as the garment takes it: the reference pose of its skeleton and the skin of its mesh.
#pragma once

#include "CoreMinimal.h"

THIRD_PARTY_INCLUDES_START
#include "garment/garment.h"
THIRD_PARTY_INCLUDES_END

class USkeletalMeshComponent;

// The component's turn and scale in the world count; its place does not. `bSkin` false leaves the vertices out; so does
// a cooked mesh without Allow CPU Access.
dcloth::platforms::Wearer WearerOf(const USkeletalMeshComponent& Character, bool bSkin);
