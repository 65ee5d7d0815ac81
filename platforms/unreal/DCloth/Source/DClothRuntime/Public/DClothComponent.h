// A garment on the character of a skeletal mesh component.
#pragma once

#include <memory>

#include "CoreMinimal.h"
#include "DClothComponent.generated.h"
#include "ProceduralMeshComponent.h"

class UDClothModel;
class USkeletalMeshComponent;

namespace dcloth::platforms {
class Garment;
}

UENUM(BlueprintType)
enum class EDClothFit : uint8 {
  Body,   // lays the garment onto bones and skin of any humanoid; takes 0.2 to 1 s, once
  Bones,  // the same by bones alone: for meshes that have other clothes in them
  Names   // the skeleton is that of training: the same names, axes and lengths
};

UENUM(BlueprintType)
enum class EDClothDetail : uint8 { Static, Skeleton, Mesh };

// Attach it to the skeletal mesh, or put it beside one in the same actor, and give it a two-sided material. Vertices
// are in the world: the component is absolute and stays where the garment's origin is. It runs after all animation of
// the frame.
UCLASS(ClassGroup = (Rendering), meta = (BlueprintSpawnableComponent))
class DCLOTHRUNTIME_API UDClothComponent : public UProceduralMeshComponent {
  GENERATED_BODY()

 public:
  explicit UDClothComponent(const FObjectInitializer& ObjectInitializer);

  // Read when the garment is dressed: in the first frame, and after Undress.
  UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "dcloth")
  TObjectPtr<UDClothModel> Model;

  UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "dcloth")
  EDClothFit Fit = EDClothFit::Body;

  // These may change from frame to frame.
  UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "dcloth")
  EDClothDetail Detail = EDClothDetail::Mesh;

  // Spreads the network's work over frames.
  UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "dcloth")
  bool bPipelined = true;

  // The mesh stage runs in every second tick.
  UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "dcloth")
  bool bHalfRateMesh = false;

  // A character at rest costs drawing alone.
  UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "dcloth")
  bool bFreezeIdle = false;

  // Pushes vertices out of the body, where the model holds one.
  UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "dcloth")
  bool bOutsideBody = true;

  // The velocity of the air in the world, centimetres a second, for garments that were trained with wind.
  UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "dcloth")
  FVector Wind = FVector::ZeroVector;

  // How the garment fits, once it is dressed; see dcloth_fit.h. Warnings are bits of DCLOTH_FIT_*.
  UPROPERTY(VisibleAnywhere, BlueprintReadOnly, Transient, Category = "dcloth")
  float FitScale = 0;
  UPROPERTY(VisibleAnywhere, BlueprintReadOnly, Transient, Category = "dcloth")
  float FitGapMillimetres = 0;
  UPROPERTY(VisibleAnywhere, BlueprintReadOnly, Transient, Category = "dcloth")
  int32 FitWarnings = 0;

  // Why the garment is not on its character, or why its last frame was refused. The log says it too, once.
  UPROPERTY(VisibleAnywhere, BlueprintReadOnly, Transient, Category = "dcloth")
  FString LastError;

  // Before the frame in which the character is moved without motion, such as a portal: the cloth hangs as before.
  UFUNCTION(BlueprintCallable, Category = "dcloth")
  void Jump();

  // Before a cut or a spawn: forgets all motion.
  UFUNCTION(BlueprintCallable, Category = "dcloth")
  void ResetCloth();

  // Takes the garment off. The next frame puts it on again, with another model or on another mesh.
  UFUNCTION(BlueprintCallable, Category = "dcloth")
  void Undress();

  UFUNCTION(BlueprintCallable, Category = "dcloth")
  bool IsDressed() const { return Garment != nullptr; }

  void TickComponent(float DeltaTime, ELevelTick TickType, FActorComponentTickFunction* ThisTickFunction) override;
  void EndPlay(const EEndPlayReason::Type Reason) override;

 private:
  USkeletalMeshComponent* FindCharacter() const;
  void Dress();
  void Upload();
  void Fail(const std::string& Error);

  UPROPERTY(Transient)
  TObjectPtr<USkeletalMeshComponent> Character;

  std::shared_ptr<dcloth::platforms::Garment> Garment;  // unique; shared_ptr, as its type is not complete here
  TArray<FVector> Vertices, Normals;
  FVector LastWind = FVector::ZeroVector;
  bool bRefused = false;
};
