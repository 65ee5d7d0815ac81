#include "DClothComponent.h"

#include <string>

#include "Components/SkeletalMeshComponent.h"
#include "DClothModel.h"
#include "Engine/SkeletalMesh.h"
#include "GameFramework/Actor.h"
#include "Wearer.h"

DEFINE_LOG_CATEGORY_STATIC(LogDCloth, Log, All);

using dcloth::platforms::GarmentFrame;
using dcloth::platforms::GarmentModel;
using dcloth::platforms::Match;

namespace {

constexpr dcloth_space Space = {sizeof(dcloth_space),         DCLOTH_AXIS_MINUS_Y, DCLOTH_AXIS_Z, DCLOTH_AXIS_X, 0.01f,
                                DCLOTH_JOINT_FRAMES_CONVERTED};
constexpr double Reach = 10000;  // centimetres; floats are 8 um apart there

// What the mesh needs none of.
const TArray<FVector2D> NoTexture;
const TArray<FColor> NoColors;
const TArray<FProcMeshTangent> NoTangents;

}  // namespace

UDClothComponent::UDClothComponent(const FObjectInitializer& ObjectInitializer) : Super(ObjectInitializer) {
  PrimaryComponentTick.bCanEverTick = true;
  PrimaryComponentTick.TickGroup = TG_PostUpdateWork;
  SetUsingAbsoluteLocation(true);
  SetUsingAbsoluteRotation(true);
  SetUsingAbsoluteScale(true);
}

USkeletalMeshComponent* UDClothComponent::FindCharacter() const {
  if (USkeletalMeshComponent* const Parent = Cast<USkeletalMeshComponent>(GetAttachParent())) return Parent;
  return GetOwner() != nullptr ? GetOwner()->FindComponentByClass<USkeletalMeshComponent>() : nullptr;
}

void UDClothComponent::Dress() {
  Character = FindCharacter();
  if (Model == nullptr || Character == nullptr || Character->GetSkeletalMeshAsset() == nullptr) {
    return Fail("needs a Model (a .dcloth file) and a skeletal mesh, as its parent or in the same actor");
  }
  FString Refusal;
  const std::shared_ptr<const GarmentModel> Opened = Model->Open(Refusal);
  if (Opened == nullptr) return Fail(TCHAR_TO_UTF8(*Refusal));
  const Match How = Fit == EDClothFit::Body ? Match::kBody : Fit == EDClothFit::Bones ? Match::kBones : Match::kNames;
  std::string Error;
  Garment =
      dcloth::platforms::Garment::Create(Opened, Space, WearerOf(*Character, Fit == EDClothFit::Body), How, &Error);
  if (Garment == nullptr) return Fail(Error);
  FitScale = Garment->fit().scale;
  FitGapMillimetres = Garment->fit().gap_mm;
  FitWarnings = static_cast<int32>(Garment->fit().warnings);
  LastError.Empty();
  LastWind = FVector::ZeroVector;
  AddTickPrerequisiteComponent(Character);
  SetWorldRotation(FQuat::Identity);
  SetWorldScale3D(FVector::OneVector);
}

void UDClothComponent::Undress() {
  if (Character != nullptr) RemoveTickPrerequisiteComponent(Character);
  Character = nullptr;
  Garment.reset();
  bRefused = false;
  ClearAllMeshSections();
}

void UDClothComponent::EndPlay(const EEndPlayReason::Type Reason) {
  Undress();
  Super::EndPlay(Reason);
}

void UDClothComponent::TickComponent(float DeltaTime, ELevelTick TickType,
                                     FActorComponentTickFunction* ThisTickFunction) {
  Super::TickComponent(DeltaTime, TickType, ThisTickFunction);
  if (Garment == nullptr && !bRefused) Dress();
  if (Garment == nullptr) return;
  const USkeletalMesh* const Mesh = Character != nullptr ? Character->GetSkeletalMeshAsset() : nullptr;
  if (Mesh == nullptr || static_cast<size_t>(Mesh->GetRefSkeleton().GetNum()) != Garment->joint_count()) {
    return Undress();  // the character is gone, or is another one
  }
  const FVector At = Character->GetComponentLocation();
  const double Place[3] = {At.X, At.Y, At.Z};
  if (Garment->Follow(Place, Reach)) {
    const double* const Origin = Garment->origin();
    SetWorldLocation(FVector(Origin[0], Origin[1], Origin[2]));
  }
  for (int32 B = 0; B < Mesh->GetRefSkeleton().GetNum(); ++B) {
    const FMatrix Joint = Character->GetBoneTransform(B).ToMatrixWithScale();
    Garment->SetJoint(static_cast<size_t>(B), &Joint.M[0][0]);
  }
  std::string Error;
  if (Wind != LastWind) {
    const float Air[3] = {static_cast<float>(Wind.X), static_cast<float>(Wind.Y), static_cast<float>(Wind.Z)};
    if (!Garment->SetWind(Air, &Error))
      UE_LOG(LogDCloth, Error, TEXT("%s: %s"), *GetName(), UTF8_TO_TCHAR(Error.c_str()));
    LastWind = Wind;
  }
  constexpr uint32_t Stages[] = {DCLOTH_STAGES_STATIC, DCLOTH_STAGES_SKELETON, DCLOTH_STAGES_MESH};
  GarmentFrame Frame;
  Frame.seconds = DeltaTime;
  Frame.stages = Stages[static_cast<size_t>(Detail)];
  Frame.pipelined = bPipelined;
  Frame.half_rate_mesh = bHalfRateMesh;
  Frame.freeze_idle = bFreezeIdle;
  Frame.outside_body = bOutsideBody;
  Frame.draw = IsVisible();
  if (!Garment->Update(Frame, &Error)) {
    const FString Text = UTF8_TO_TCHAR(Error.c_str());
    if (Text != LastError) UE_LOG(LogDCloth, Error, TEXT("%s: %s"), *GetName(), *Text);
    LastError = Text;
    return;
  }
  LastError.Empty();
  if (Frame.draw) Upload();
}

void UDClothComponent::Upload() {
  const std::vector<float>&Positions = Garment->positions(), &Directions = Garment->normals();
  const int32 Count = static_cast<int32>(Positions.size() / 3);
  Vertices.SetNum(Count);
  Normals.SetNum(Count);
  for (int32 V = 0; V < Count; ++V) {
    const size_t I = 3 * static_cast<size_t>(V);
    Vertices[V] = FVector(Positions[I], Positions[I + 1], Positions[I + 2]);
    Normals[V] = FVector(Directions[I], Directions[I + 1], Directions[I + 2]);
  }
  const GarmentModel& Drawn = Garment->model();
  if (GetNumSections() > 0) return UpdateMeshSection(0, Vertices, Normals, NoTexture, NoColors, NoTangents);
  const std::vector<int32_t> Corners = Drawn.Triangles(GarmentModel::Front::kCounterClockwise);
  const TArray<int32> Triangles(Corners.data(), static_cast<int32>(Corners.size()));
  TArray<FVector2D> Places;
  Places.SetNum(Drawn.is_textured() ? Count : 0);
  for (int32 V = 0; V < Places.Num(); ++V) {
    const float* const At = Drawn.texture_coordinates() + 2 * static_cast<size_t>(V);
    Places[V] = FVector2D(At[0], At[1]);
  }
  CreateMeshSection(0, Vertices, Triangles, Normals, Places, NoColors, NoTangents, false);
}

void UDClothComponent::Fail(const std::string& Error) {
  LastError = UTF8_TO_TCHAR(Error.c_str());
  bRefused = true;
  UE_LOG(LogDCloth, Error, TEXT("%s: %s"), *GetName(), *LastError);
}

void UDClothComponent::Jump() {
  if (Garment != nullptr) Garment->Jump();
}

void UDClothComponent::ResetCloth() {
  if (Garment != nullptr) Garment->Reset();
}
