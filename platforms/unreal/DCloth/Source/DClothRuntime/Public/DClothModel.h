// A .dcloth file as an asset.
#pragma once

#include <memory>

#include "CoreMinimal.h"
#include "DClothModel.generated.h"
#include "UObject/Object.h"

namespace dcloth::platforms {
class GarmentModel;
}

UCLASS(BlueprintType)
class DCLOTHRUNTIME_API UDClothModel : public UObject {
  GENERATED_BODY()

 public:
  // Empty on success, else why the bytes were refused; they are kept all the same.
  FString SetBytes(const TArray<uint8>& NewBytes);

  // Opens the model at its first use; components share it. Null where it is refused.
  std::shared_ptr<const dcloth::platforms::GarmentModel> Open(FString& OutError);

 private:
  UPROPERTY()
  TArray<uint8> Bytes;

  std::shared_ptr<const dcloth::platforms::GarmentModel> Opened;
};
