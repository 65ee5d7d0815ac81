// The names of Unreal Engine 5 that the plugin uses, with the signatures and the arithmetic that Unreal documents, so
// that the plugin compiles and runs in a test. None of Unreal's code is here: what only Unreal can show, this cannot.
#ifndef DCLOTH_TESTS_UNREAL_STAND_IN_UNREAL_H_
#define DCLOTH_TESTS_UNREAL_STAND_IN_UNREAL_H_

#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

using int32 = int32_t;
using uint8 = uint8_t;
using uint16 = uint16_t;
using uint32 = uint32_t;
using TCHAR = wchar_t;
inline constexpr int32 INDEX_NONE = -1;

#define TEXT(text) L##text
#define DCLOTHRUNTIME_API
#define THIRD_PARTY_INCLUDES_START
#define THIRD_PARTY_INCLUDES_END
#define UCLASS(...)
#define UENUM(...)
#define UPROPERTY(...)
#define UFUNCTION(...)
#define IMPLEMENT_MODULE(Class, Name) [[maybe_unused]] static Class Name##Module;
#define DEFINE_LOG_CATEGORY_STATIC(Category, Default, Compiled)
#define UE_LOG(Category, Verbosity, Format, ...) stand_in::Log(Format, __VA_ARGS__)
#define UTF8_TO_TCHAR(text) stand_in::Wide(text).c_str()
#define TCHAR_TO_UTF8(text) stand_in::Narrow(text).c_str()

namespace stand_in {
inline std::wstring Wide(const char* text) { return {text, text + std::char_traits<char>::length(text)}; }
inline std::string Narrow(const TCHAR* text) {
  std::string narrow;
  for (; *text != 0; ++text) narrow.push_back(static_cast<char>(*text));
  return narrow;
}
inline std::vector<std::string>& Logged() {
  static std::vector<std::string> lines;
  return lines;
}
// Every %s takes the next text.
inline void Log(const TCHAR* format, const TCHAR* first, const TCHAR* second) {
  std::wstring line = format;
  for (const TCHAR* text : {first, second}) {
    const size_t at = line.find(L"%s");
    if (at != std::wstring::npos) line.replace(at, 2, text);
  }
  Logged().push_back(Narrow(line.c_str()));
}
}  // namespace stand_in

class FDefaultModuleImpl {};

class FString {
 public:
  FString() = default;
  FString(const TCHAR* text) : text_(text) {}  // NOLINT: implicit there too
  const TCHAR* operator*() const { return text_.c_str(); }
  bool IsEmpty() const { return text_.empty(); }
  void Empty() { text_.clear(); }
  bool operator!=(const FString& other) const { return text_ != other.text_; }

 private:
  std::wstring text_;
};

class FName {
 public:
  FName() = default;
  explicit FName(const TCHAR* text) : text_(text) {}
  FString ToString() const { return text_; }

 private:
  FString text_;
};

template <typename T>
class TArray {
 public:
  TArray() = default;
  TArray(const T* first, int32 count) : items_(first, first + count) {}
  int32 Num() const { return static_cast<int32>(items_.size()); }
  T* GetData() { return items_.data(); }
  const T* GetData() const { return items_.data(); }
  void Add(const T& item) { items_.push_back(item); }
  void SetNum(int32 count) { items_.resize(static_cast<size_t>(count)); }
  T& operator[](int32 i) { return items_[static_cast<size_t>(i)]; }
  const T& operator[](int32 i) const { return items_[static_cast<size_t>(i)]; }
  auto begin() const { return items_.begin(); }
  auto end() const { return items_.end(); }

 private:
  std::vector<T> items_;
};
template <typename T>
using TIndirectArray = TArray<T>;

template <typename T>
class TObjectPtr {
 public:
  TObjectPtr(T* object = nullptr) : object_(object) {}  // NOLINT: implicit there too
  operator T*() const { return object_; }               // NOLINT
  T* operator->() const { return object_; }
  T& operator*() const { return *object_; }

 private:
  T* object_;
};

struct FMath {
  template <typename T>
  static T Min(T a, T b) {
    return a < b ? a : b;
  }
};

struct FVector3f {
  float X = 0, Y = 0, Z = 0;
};
struct FVector2D {
  FVector2D() = default;
  FVector2D(double x, double y) : X(x), Y(y) {}
  double X = 0, Y = 0;
};
struct FColor {};
struct FProcMeshTangent {};
struct FVector {
  double X = 0, Y = 0, Z = 0;
  static const FVector ZeroVector, OneVector;
  FVector() = default;
  FVector(double x, double y, double z) : X(x), Y(y), Z(z) {}
  explicit FVector(const FVector3f& v)
      : X(static_cast<double>(v.X)), Y(static_cast<double>(v.Y)), Z(static_cast<double>(v.Z)) {}
  FVector operator+(const FVector& v) const { return {X + v.X, Y + v.Y, Z + v.Z}; }
  FVector operator*(const FVector& v) const { return {X * v.X, Y * v.Y, Z * v.Z}; }
  bool operator!=(const FVector& v) const { return X != v.X || Y != v.Y || Z != v.Z; }
};
inline const FVector FVector::ZeroVector{0, 0, 0};
inline const FVector FVector::OneVector{1, 1, 1};

// Rows act on row vectors: M[3] is the translation.
struct FMatrix {
  double M[4][4];
};

struct FQuat {
  double X = 0, Y = 0, Z = 0, W = 1;
  static const FQuat Identity;
  // a * b turns by b first.
  FQuat operator*(const FQuat& b) const {
    return {W * b.X + X * b.W + Y * b.Z - Z * b.Y, W * b.Y - X * b.Z + Y * b.W + Z * b.X,
            W * b.Z + X * b.Y - Y * b.X + Z * b.W, W * b.W - X * b.X - Y * b.Y - Z * b.Z};
  }
  FVector RotateVector(const FVector& v) const;
};
inline const FQuat FQuat::Identity{};

// Scales, then turns, then moves. a * b does a first.
class FTransform {
 public:
  FTransform() = default;
  FTransform(const FQuat& turn, const FVector& place, const FVector& scale = FVector::OneVector)
      : turn_(turn), place_(place), scale_(scale) {}
  FTransform operator*(const FTransform& b) const {
    return {b.turn_ * turn_, b.TransformPosition(place_), scale_ * b.scale_};
  }
  FVector TransformPosition(const FVector& v) const { return turn_.RotateVector(scale_ * v) + place_; }
  FMatrix ToMatrixWithScale() const {
    const FVector axes[3] = {turn_.RotateVector({scale_.X, 0, 0}), turn_.RotateVector({0, scale_.Y, 0}),
                             turn_.RotateVector({0, 0, scale_.Z})};
    FMatrix m;
    for (int r = 0; r < 4; ++r) {
      const FVector& row = r < 3 ? axes[r] : place_;
      m.M[r][0] = row.X, m.M[r][1] = row.Y, m.M[r][2] = row.Z, m.M[r][3] = r < 3 ? 0 : 1;
    }
    return m;
  }
  const FQuat& GetRotation() const { return turn_; }
  const FVector& GetTranslation() const { return place_; }
  // This transform as `b` sees it: the result * b is this transform.
  FTransform GetRelativeTransform(const FTransform& b) const {
    const FQuat back = {-b.turn_.X, -b.turn_.Y, -b.turn_.Z, b.turn_.W};
    const FVector shrink = {1 / b.scale_.X, 1 / b.scale_.Y, 1 / b.scale_.Z};
    const FVector away = {place_.X - b.place_.X, place_.Y - b.place_.Y, place_.Z - b.place_.Z};
    return {back * turn_, shrink * back.RotateVector(away), scale_ * shrink};
  }

 private:
  FQuat turn_;
  FVector place_, scale_ = FVector::OneVector;
};

inline FVector FQuat::RotateVector(const FVector& v) const {
  const FQuat q = *this * FQuat{v.X, v.Y, v.Z, 0} * FQuat{-X, -Y, -Z, W};
  return {q.X, q.Y, q.Z};
}

// Objects. Nothing collects them here: tests own them.
class UObject;
struct UClass {
  UObject* (*make)();
};
enum EObjectFlags { RF_NoFlags = 0 };
class FObjectInitializer {};
class UObject {
 public:
  virtual ~UObject() = default;
  FString GetName() const { return TEXT("object"); }
};
template <typename T>
T* NewObject(UObject*, UClass* type, FName, EObjectFlags) {
  return static_cast<T*>(type->make());
}
template <typename T>
T* Cast(UObject* object) {
  return dynamic_cast<T*>(object);
}

enum ETickingGroup { TG_PrePhysics, TG_PostUpdateWork };
enum ELevelTick { LEVELTICK_All };
namespace EEndPlayReason {
enum Type { Destroyed };
}
struct FActorComponentTickFunction {
  bool bCanEverTick = false;
  ETickingGroup TickGroup = TG_PrePhysics;
};

class AActor;
class UActorComponent : public UObject {
 public:
  explicit UActorComponent(const FObjectInitializer& = {}) {}
  AActor* GetOwner() const { return owner; }
  virtual void TickComponent(float, ELevelTick, FActorComponentTickFunction*) {}
  virtual void EndPlay(const EEndPlayReason::Type) {}
  void AddTickPrerequisiteComponent(UActorComponent* other) { before = other; }
  void RemoveTickPrerequisiteComponent(UActorComponent*) { before = nullptr; }

  FActorComponentTickFunction PrimaryComponentTick;
  AActor* owner = nullptr;
  UActorComponent* before = nullptr;
};

class USceneComponent : public UActorComponent {
 public:
  using UActorComponent::UActorComponent;
  USceneComponent* GetAttachParent() const { return parent; }
  FVector GetComponentLocation() const { return place; }
  FQuat GetComponentQuat() const { return turn; }
  FVector GetComponentScale() const { return scale; }
  FTransform GetComponentTransform() const { return {turn, place, scale}; }
  void SetUsingAbsoluteLocation(bool on) { absolute = on; }
  void SetUsingAbsoluteRotation(bool on) { absolute = absolute && on; }
  void SetUsingAbsoluteScale(bool on) { absolute = absolute && on; }
  void SetWorldLocation(const FVector& to) { place = to; }
  void SetWorldRotation(const FQuat& to) { turn = to; }
  void SetWorldScale3D(const FVector& to) { scale = to; }
  bool IsVisible() const { return visible; }

  USceneComponent* parent = nullptr;
  FQuat turn;
  FVector place, scale = FVector::OneVector;
  bool absolute = false, visible = true;
};

class AActor : public UObject {
 public:
  template <typename T>
  T* FindComponentByClass() const {
    for (UActorComponent* component : components) {
      if (T* const found = Cast<T>(component)) return found;
    }
    return nullptr;
  }
  std::vector<UActorComponent*> components;
};

// The skeleton and the render data of a mesh.
class FReferenceSkeleton {
 public:
  int32 GetNum() const { return pose.Num(); }
  int32 GetParentIndex(int32 bone) const { return parents[bone]; }
  FName GetBoneName(int32 bone) const { return names[bone]; }
  const TArray<FTransform>& GetRefBonePose() const { return pose; }

  TArray<FName> names;
  TArray<int32> parents;
  TArray<FTransform> pose;
};
using FBoneIndexType = uint16;
struct FSkelMeshRenderSection {
  uint32 BaseVertexIndex = 0, NumVertices = 0;
  TArray<FBoneIndexType> BoneMap;
};
class FPositionVertexBuffer {
 public:
  const void* GetVertexData() const { return points.GetData(); }
  const FVector3f& VertexPosition(uint32 vertex) const { return points[static_cast<int32>(vertex)]; }
  TArray<FVector3f> points;
};
struct FStaticMeshVertexBuffers {
  FPositionVertexBuffer PositionVertexBuffer;
};
class FSkinWeightDataVertexBuffer {
 public:
  bool IsWeightDataValid() const { return valid; }
  bool valid = true;
};
class FSkinWeightVertexBuffer {
 public:
  uint32 GetMaxBoneInfluences() const { return influences; }
  uint32 GetBoneIndex(uint32 vertex, uint32 i) const { return bones[static_cast<int32>(vertex * influences + i)]; }
  uint16 GetBoneWeight(uint32 vertex, uint32 i) const { return weights[static_cast<int32>(vertex * influences + i)]; }
  const FSkinWeightDataVertexBuffer* GetDataVertexBuffer() const { return &data; }
  uint32 influences = 4;
  TArray<uint32> bones;
  TArray<uint16> weights;
  FSkinWeightDataVertexBuffer data;
};
class FMultiSizeIndexContainer {
 public:
  bool IsIndexBufferValid() const { return corners.Num() != 0; }
  void GetIndexBuffer(TArray<uint32>& out) const { out = corners; }
  TArray<uint32> corners;
};
class FSkeletalMeshLODRenderData {
 public:
  const FSkinWeightVertexBuffer* GetSkinWeightVertexBuffer() const { return &weights; }
  FStaticMeshVertexBuffers StaticVertexBuffers;
  FMultiSizeIndexContainer MultiSizeIndexContainer;
  TArray<FSkelMeshRenderSection> RenderSections;
  FSkinWeightVertexBuffer weights;
};
class FSkeletalMeshRenderData {
 public:
  TIndirectArray<FSkeletalMeshLODRenderData> LODRenderData;
};
class USkeletalMesh : public UObject {
 public:
  const FReferenceSkeleton& GetRefSkeleton() const { return skeleton; }
  FSkeletalMeshRenderData* GetResourceForRendering() const { return render.get(); }
  FReferenceSkeleton skeleton;
  std::unique_ptr<FSkeletalMeshRenderData> render;
};
class USkeletalMeshComponent : public USceneComponent {
 public:
  USkeletalMesh* GetSkeletalMeshAsset() const { return mesh; }
  FTransform GetBoneTransform(int32 bone) const { return pose[bone] * GetComponentTransform(); }
  USkeletalMesh* mesh = nullptr;
  TArray<FTransform> pose;  // bone to component
};

class UProceduralMeshComponent : public USceneComponent {
 public:
  using USceneComponent::USceneComponent;
  int32 GetNumSections() const { return vertices.Num() != 0; }
  void ClearAllMeshSections() { vertices = {}; }
  void CreateMeshSection(int32, const TArray<FVector>& points, const TArray<int32>& triangles,
                         const TArray<FVector>& directions, const TArray<FVector2D>& uv, const TArray<FColor>&,
                         const TArray<FProcMeshTangent>&, bool) {
    vertices = points, corners = triangles, normals = directions, places = uv;
  }
  void UpdateMeshSection(int32, const TArray<FVector>& points, const TArray<FVector>& directions,
                         const TArray<FVector2D>&, const TArray<FColor>&, const TArray<FProcMeshTangent>&) {
    vertices = points, normals = directions;
  }
  TArray<FVector> vertices, normals;
  TArray<FVector2D> places;
  TArray<int32> corners;
};

namespace ELogVerbosity {
enum Type { Error };
}
class FFeedbackContext {
 public:
  void Logf(ELogVerbosity::Type, const TCHAR* format, const TCHAR* first, const TCHAR* second) {
    stand_in::Log(format, first, second);
  }
};
class UFactory : public UObject {
 public:
  virtual UObject* FactoryCreateBinary(UClass*, UObject*, FName, EObjectFlags, UObject*, const TCHAR*, const uint8*&,
                                       const uint8*, FFeedbackContext*) = 0;
  UClass* SupportedClass = nullptr;
  bool bCreateNew = true, bEditorImport = false;
  TArray<FString> Formats;
};

// What Unreal's header tool writes for a class; tests/unreal/CMakeLists.txt chooses it in CLASS.generated.h.
namespace stand_in {
template <typename T>
UObject* Make() {
  if constexpr (std::is_constructible_v<T, FObjectInitializer>) {
    return new T(FObjectInitializer());
  } else {
    return new T();
  }
}
template <typename T>
UClass* ClassOf() {
  static UClass type = {Make<T>};
  return &type;
}
}  // namespace stand_in
#define STAND_IN_BODY(Class, Base)                                    \
 public:                                                              \
  using Super = Base;                                                 \
  static UClass* StaticClass() { return stand_in::ClassOf<Class>(); } \
                                                                      \
 private:

#endif  // DCLOTH_TESTS_UNREAL_STAND_IN_UNREAL_H_
