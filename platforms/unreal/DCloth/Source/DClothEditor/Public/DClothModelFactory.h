// Imports .dcloth files: drag one into the content browser.
#pragma once

#include "CoreMinimal.h"
#include "DClothModelFactory.generated.h"
#include "Factories/Factory.h"

UCLASS()
class UDClothModelFactory : public UFactory {
  GENERATED_BODY()

 public:
  UDClothModelFactory();

  UObject* FactoryCreateBinary(UClass* Class, UObject* Parent, FName Name, EObjectFlags Flags, UObject* Context,
                               const TCHAR* Type, const uint8*& Buffer, const uint8* BufferEnd,
                               FFeedbackContext* Warn) override;
};
