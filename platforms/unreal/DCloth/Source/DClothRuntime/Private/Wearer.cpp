#include "Wearer.h"

#include "Components/SkeletalMeshComponent.h"
#include "Engine/SkeletalMesh.h"
#include "Rendering/SkeletalMeshRenderData.h"

using dcloth::platforms::Wearer;

namespace {

void AddSkin(const FSkeletalMeshLODRenderData& Lod, const FTransform& ToWorld, Wearer& Result) {
  const FPositionVertexBuffer& Points = Lod.StaticVertexBuffers.PositionVertexBuffer;
  const FSkinWeightVertexBuffer* const Weights = Lod.GetSkinWeightVertexBuffer();
  if (Points.GetVertexData() == nullptr || Weights == nullptr || !Weights->GetDataVertexBuffer()->IsWeightDataValid() ||
      !Lod.MultiSizeIndexContainer.IsIndexBufferValid()) {
    return;
  }
  const uint32 Influences = FMath::Min<uint32>(Weights->GetMaxBoneInfluences(), Wearer::kInfluences);
  for (const FSkelMeshRenderSection& Section : Lod.RenderSections) {  // in the order of their vertices
    for (uint32 V = Section.BaseVertexIndex; V < Section.BaseVertexIndex + Section.NumVertices; ++V) {
      uint32_t Joints[Wearer::kInfluences];
      float Shares[Wearer::kInfluences];
      for (uint32 I = 0; I < Influences; ++I) {
        Joints[I] = Section.BoneMap[static_cast<int32>(Weights->GetBoneIndex(V, I))];
        Shares[I] = static_cast<float>(Weights->GetBoneWeight(V, I));
      }
      const FVector Place = ToWorld.TransformPosition(FVector(Points.VertexPosition(V)));
      const double At[3] = {Place.X, Place.Y, Place.Z};
      Result.AddBodyVertex(At, Joints, Shares, Influences);
    }
  }
  TArray<uint32> Corners;
  Lod.MultiSizeIndexContainer.GetIndexBuffer(Corners);
  Result.body_triangles.assign(Corners.GetData(), Corners.GetData() + Corners.Num());
}

}  // namespace

Wearer WearerOf(const USkeletalMeshComponent& Character, bool bSkin) {
  Wearer Result;
  const USkeletalMesh* const Mesh = Character.GetSkeletalMeshAsset();
  if (Mesh == nullptr) return Result;
  const FTransform ToWorld(Character.GetComponentQuat(), FVector::ZeroVector, Character.GetComponentScale());
  const FReferenceSkeleton& Skeleton = Mesh->GetRefSkeleton();
  const TArray<FTransform>& Local = Skeleton.GetRefBonePose();
  TArray<FTransform> Rest;
  for (int32 B = 0; B < Skeleton.GetNum(); ++B) {
    const int32 Parent = Skeleton.GetParentIndex(B);  // always before its children
    Rest.Add(Parent == INDEX_NONE ? Local[B] : Local[B] * Rest[Parent]);
    const FMatrix Bind = (Rest[B] * ToWorld).ToMatrixWithScale();
    // Unreal's rows act on row vectors: they are the columns of a matrix that acts on column vectors.
    Result.AddJoint(TCHAR_TO_UTF8(*Skeleton.GetBoneName(B).ToString()), &Bind.M[0][0]);
  }
  const FSkeletalMeshRenderData* const Render = Mesh->GetResourceForRendering();
  if (bSkin && Render != nullptr && Render->LODRenderData.Num() > 0) AddSkin(Render->LODRenderData[0], ToWorld, Result);
  return Result;
}
