// The Unreal component in a world of stand-ins: its vertices are those of `dcloth run`, whatever the component's place,
// turn and scale; it reads skeleton and skin as they are; what goes wrong is said once and mended by the next good
// frame. Arguments: MODEL SEQUENCE RUN, the model, what it plays and what `dcloth run` made of it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>

#include "DClothComponent.h"
#include "DClothModel.h"
#include "DClothModelFactory.h"
#include "Wearer.h"
#include "converter/sequence.h"

namespace dcloth::testing {
namespace {

using converter::SafeFile;
using converter::Sequence;
using platforms::GarmentModel;
using platforms::Wearer;

const char* model_path = nullptr;
const char* sequence_path = nullptr;
const char* run_path = nullptr;

std::vector<uint8_t> ReadBytes(const char* path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// Training's space to Unreal's.
FVector UnrealPoint(double x, double y, double z) { return {100 * z, -100 * x, 100 * y}; }

// A rigid matrix of training, rows contiguous.
FTransform UnrealTransform(const float* m) {
  // Unreal's axes in training's order are z, -x, y: their images, in Unreal's coordinates, are the columns.
  const auto turned = [m](int column, double sign) {
    const FVector v = UnrealPoint(m[column], m[4 + column], m[8 + column]);
    return FVector(v.X * sign / 100, v.Y * sign / 100, v.Z * sign / 100);
  };
  const FVector x = turned(2, 1), y = turned(0, -1), z = turned(1, 1);
  // Shepperd's method: the largest of the four is divided by.
  const double trace = x.X + y.Y + z.Z, most = std::max({trace, x.X, y.Y, z.Z});
  FQuat q;
  if (most == trace) {
    q = {y.Z - z.Y, z.X - x.Z, x.Y - y.X, 1 + trace};
  } else if (most == x.X) {
    q = {1 + x.X - y.Y - z.Z, x.Y + y.X, z.X + x.Z, y.Z - z.Y};
  } else if (most == y.Y) {
    q = {x.Y + y.X, 1 - x.X + y.Y - z.Z, y.Z + z.Y, z.X - x.Z};
  } else {
    q = {z.X + x.Z, y.Z + z.Y, 1 - x.X - y.Y + z.Z, x.Y - y.X};
  }
  const double length = std::sqrt(q.X * q.X + q.Y * q.Y + q.Z * q.Z + q.W * q.W);
  return {{q.X / length, q.Y / length, q.Z / length, q.W / length}, UnrealPoint(m[3], m[7], m[11])};
}

FQuat Yaw(double degrees) {
  const double half = degrees * M_PI / 360;
  return {0, 0, std::sin(half), std::cos(half)};
}

// Bones have no scale of their own, as in most files: the component's scale is theirs in the world.
FTransform InComponent(const FTransform& bone, const USceneComponent& component) {
  const FTransform seen = bone.GetRelativeTransform(component.GetComponentTransform());
  return {seen.GetRotation(), seen.GetTranslation()};
}

// An actor with a skeletal mesh and a garment, as a blueprint makes it.
struct Stage {
  Stage() : garment(FObjectInitializer()) {
    character.mesh = &mesh;
    character.owner = garment.owner = &actor;
    actor.components = {&garment, &character};
    garment.Model = &model;
    stand_in::Logged().clear();
  }
  void Load(const std::vector<uint8_t>& bytes) {
    const FString error = model.SetBytes({bytes.data(), static_cast<int32>(bytes.size())});
    EXPECT_TRUE(error.IsEmpty()) << stand_in::Narrow(*error);
  }
  void Frame(float seconds = 1 / 30.0f) { garment.TickComponent(seconds, LEVELTICK_All, nullptr); }
  // Bones in the world.
  void Pose(const std::vector<FTransform>& bones) {
    character.pose = {};
    for (const FTransform& bone : bones) character.pose.Add(InComponent(bone, character));
  }

  AActor actor;
  USkeletalMesh mesh;
  USkeletalMeshComponent character;
  UDClothModel model;
  UDClothComponent garment;
};

// The figure of training as a skeletal mesh: parents before their children.
struct Skeleton {
  explicit Skeleton(const GarmentModel& model) {
    const uint32_t count = model.info().joint_count;
    std::vector<bool> placed(count);
    while (order.size() < count) {
      for (uint32_t j = 0; j < count; ++j) {
        const int32_t above = dcloth_model_joint_parent(model.get(), j);
        if (placed[j] || (above >= 0 && !placed[static_cast<size_t>(above)])) continue;
        placed[j] = true;
        order.push_back(j);
        parents.push_back(above < 0 ? INDEX_NONE
                                    : static_cast<int32>(std::find(order.begin(), order.end(), above) - order.begin()));
        names.push_back(dcloth_model_joint_name(model.get(), j));
      }
    }
    for (const uint32_t j : order) {
      float bind[16];
      EXPECT_EQ(dcloth_model_joint_bind(model.get(), j, bind), DCLOTH_OK);
      binds.push_back(UnrealTransform(bind));
    }
  }
  // As the component keeps it that stands at the world's origin.
  void PutInto(USkeletalMesh* mesh, const USceneComponent& component) const {
    std::vector<FTransform> rest;
    for (size_t b = 0; b < binds.size(); ++b) {
      rest.push_back(InComponent(binds[b], component));
      mesh->skeleton.names.Add(FName(stand_in::Wide(names[b].c_str()).c_str()));
      mesh->skeleton.parents.Add(parents[b]);
      mesh->skeleton.pose.Add(
          parents[b] == INDEX_NONE ? rest[b] : rest[b].GetRelativeTransform(rest[static_cast<size_t>(parents[b])]));
    }
  }

  std::vector<uint32_t> order;  // joints of the model
  std::vector<int32> parents;
  std::vector<std::string> names;
  std::vector<FTransform> binds;
};

std::shared_ptr<const GarmentModel> Opened(const std::vector<uint8_t>& bytes) {
  std::string error;
  std::shared_ptr<const GarmentModel> model = GarmentModel::Open(bytes.data(), bytes.size(), &error);
  EXPECT_NE(model, nullptr) << error;
  return model;
}

// A skirt on the figure of training, in a component that is turned as mannequins are, scaled, and kilometres away.
TEST(UnrealComponentTest, VerticesAreThoseOfTheCommandLine) {
  const std::vector<uint8_t> bytes = ReadBytes(model_path);
  const Skeleton skeleton(*Opened(bytes));
  const Sequence sequence = converter::ReadSequence(sequence_path);
  const std::vector<uint32_t> map = converter::MapJoints(sequence, skeleton.names);
  const SafeFile run = SafeFile::Read(run_path);
  const std::vector<float> expected = converter::FloatsOf(run, run.Require("positions"));
  ASSERT_EQ(expected.size() % sequence.frame_count, 0u);
  const size_t floats = expected.size() / sequence.frame_count;
  struct Case {
    EDClothFit fit;
    double yaw, scale;
    FVector place;
  };
  for (const Case& c :
       {Case{EDClothFit::Names, 0, 1, {0, 0, 0}}, Case{EDClothFit::Bones, 0, 1, {0, 0, 0}},
        Case{EDClothFit::Names, -90, 1, {3e6, -2e6, 500}}, Case{EDClothFit::Bones, -90, 0.4, {3e6, -2e6, 500}}}) {
    Stage stage;
    stage.Load(bytes);
    stage.garment.Fit = c.fit;
    stage.garment.bPipelined = stage.garment.bOutsideBody = false;
    stage.character.turn = Yaw(c.yaw);
    stage.character.scale = {c.scale, c.scale, c.scale};
    skeleton.PutInto(&stage.mesh, stage.character);
    stage.character.place = c.place;
    double worst = 0;
    for (size_t f = 0; f < sequence.frame_count; ++f) {
      std::vector<float> matrices(16 * map.size());
      converter::GatherPose(sequence, f, map, matrices);
      std::vector<FTransform> bones;
      for (size_t b = 0; b < map.size(); ++b) {
        const FTransform bone = UnrealTransform(&matrices[16 * b]);
        bones.push_back({bone.GetRotation(), bone.GetTranslation() + c.place});
      }
      stage.Pose(bones);
      stage.Frame();
      ASSERT_TRUE(stage.garment.IsDressed()) << stand_in::Narrow(*stage.garment.LastError);
      const dcloth_model_info info = Opened(bytes)->info();
      ASSERT_EQ(static_cast<uint32_t>(stage.garment.vertices.Num()), info.textured_vertex_count);
      for (uint32_t v = info.vertex_count; v < info.textured_vertex_count; ++v) {
        const FVector at_seam = stage.garment.vertices[info.seam_vertices[v - info.vertex_count]];
        ASSERT_EQ(stage.garment.vertices[static_cast<int32>(v)].X, at_seam.X);
      }
      for (int32 v = 0; v < static_cast<int32>(info.vertex_count); ++v) {
        const float* p = &expected[f * floats + 3 * static_cast<size_t>(v)];
        const FVector there = UnrealPoint(p[0], p[1], p[2]) + c.place;
        const FVector here = stage.garment.GetComponentTransform().TransformPosition(stage.garment.vertices[v]);
        worst = std::max({worst, std::abs(here.X - there.X), std::abs(here.Y - there.Y), std::abs(here.Z - there.Z)});
      }
    }
    std::printf("fit %d, yaw %.0f, scale %.1f, %.0f km away: %zu frames, worst %.5f mm\n", static_cast<int>(c.fit),
                c.yaw, c.scale, std::hypot(c.place.X, c.place.Y) / 1e5, sequence.frame_count, 10 * worst);
    EXPECT_LT(10 * worst, 0.01) << "mm";
    EXPECT_TRUE(stand_in::Logged().empty());
    EXPECT_TRUE(stage.garment.absolute);
    EXPECT_EQ(stage.garment.before, &stage.character);
    EXPECT_EQ(stage.garment.PrimaryComponentTick.TickGroup, TG_PostUpdateWork);
    EXPECT_EQ(static_cast<size_t>(stage.garment.corners.Num()), 3u * Opened(bytes)->info().triangle_count);
    ASSERT_EQ(stage.garment.places.Num(), stage.garment.vertices.Num());
    EXPECT_EQ(stage.garment.places[7].Y, static_cast<double>(Opened(bytes)->info().texture_coordinates[15]));
    EXPECT_NEAR(stage.garment.FitScale, c.fit == EDClothFit::Bones ? 1 : 0, 1e-3);
  }
}

// Two sections, each with bones of its own, as the engine splits a mesh.
TEST(UnrealComponentTest, ReadsTheSkin) {
  Stage stage;
  FReferenceSkeleton& skeleton = stage.mesh.skeleton;
  for (const TCHAR* name : {TEXT("pelvis"), TEXT("thigh_l"), TEXT("thigh_r")}) skeleton.names.Add(FName(name));
  for (const int32 parent : {INDEX_NONE, 0, 0}) skeleton.parents.Add(parent);
  for (const double y : {0.0, -10.0, 10.0}) skeleton.pose.Add(FTransform(FQuat::Identity, {0, y, 90}));
  stage.character.turn = Yaw(90);
  stage.character.scale = {2, 2, 2};
  stage.character.place = {1e6, 0, 0};  // counts for poses alone

  stage.mesh.render = std::make_unique<FSkeletalMeshRenderData>();
  FSkeletalMeshLODRenderData lod;
  for (const float x : {1.0f, 2.0f, 3.0f}) lod.StaticVertexBuffers.PositionVertexBuffer.points.Add({x, 5, 80});
  lod.weights.influences = 2;
  for (const uint32 bone : {0u, 1u, 1u, 0u, 0u, 0u}) lod.weights.bones.Add(bone);
  for (const uint16 weight : {uint16{65535}, uint16{0}, uint16{32768}, uint16{32767}, uint16{65535}, uint16{0}}) {
    lod.weights.weights.Add(weight);
  }
  for (const uint32 corner : {0u, 1u, 2u}) lod.MultiSizeIndexContainer.corners.Add(corner);
  FSkelMeshRenderSection first, second;
  first.NumVertices = 2, second.BaseVertexIndex = 2, second.NumVertices = 1;
  for (const uint16 bone : {uint16{2}, uint16{0}}) first.BoneMap.Add(bone);
  second.BoneMap.Add(1);
  lod.RenderSections.Add(first), lod.RenderSections.Add(second);
  stage.mesh.render->LODRenderData.Add(lod);

  const Wearer wearer = WearerOf(stage.character, true);
  EXPECT_EQ(wearer.joint_names, (std::vector<std::string>{"pelvis", "thigh_l", "thigh_r"}));
  ASSERT_EQ(wearer.body_vertex_count(), 3u);
  EXPECT_EQ(wearer.body_triangles, (std::vector<uint32_t>{0, 1, 2}));
  const auto joint = [&](size_t v, size_t i) { return wearer.body_joints[Wearer::kInfluences * v + i]; };
  const auto weight = [&](size_t v, size_t i) { return wearer.body_weights[Wearer::kInfluences * v + i]; };
  EXPECT_EQ(joint(0, 0), 2u);
  EXPECT_EQ(joint(1, 0), 0u);
  EXPECT_EQ(joint(1, 1), 2u);
  EXPECT_EQ(joint(2, 0), 1u);
  EXPECT_EQ(weight(0, 1), 0);
  EXPECT_NEAR(weight(1, 0) / weight(1, 1), 1, 1e-4);
  // A quarter turn takes x to y; everything is twice as large.
  EXPECT_NEAR(wearer.body_positions[0], -10, 1e-4);
  EXPECT_NEAR(wearer.body_positions[1], 2, 1e-4);
  EXPECT_NEAR(wearer.body_positions[2], 160, 1e-4);
  EXPECT_NEAR(wearer.bind_matrices[16 + 12], 20, 1e-4);   // the left thigh: 10 to the left, twice, turned
  EXPECT_NEAR(wearer.bind_matrices[16 + 14], 360, 1e-4);  // and 90 above the pelvis, twice
  EXPECT_NEAR(wearer.bind_matrices[1], 2, 1e-6);

  EXPECT_EQ(WearerOf(stage.character, false).body_vertex_count(), 0u);
  stage.mesh.render->LODRenderData[0].weights.data.valid = false;  // a cooked mesh
  EXPECT_EQ(WearerOf(stage.character, true).body_vertex_count(), 0u);
}

TEST(UnrealComponentTest, SaysWhatIsWrongOnceAndGoesOn) {
  const std::vector<uint8_t> bytes = ReadBytes(model_path);
  const Skeleton skeleton(*Opened(bytes));
  Stage stage;
  stage.garment.Fit = EDClothFit::Names;
  for (int f = 0; f < 3; ++f) stage.Frame();
  EXPECT_EQ(stand_in::Logged().size(), 1u);  // the model is empty
  EXPECT_FALSE(stage.garment.IsDressed());

  stage.Load(bytes);
  skeleton.PutInto(&stage.mesh, stage.character);
  stage.Pose(skeleton.binds);
  stage.garment.Undress();
  stage.Frame();
  ASSERT_TRUE(stage.garment.IsDressed());
  EXPECT_TRUE(stage.garment.LastError.IsEmpty());
  const FVector before = stage.garment.vertices[0];

  std::vector<FTransform> broken = skeleton.binds;
  broken[0] = FTransform(FQuat::Identity, {std::nan(""), 0, 0});
  stage.Pose(broken);
  stand_in::Logged().clear();
  for (int f = 0; f < 3; ++f) stage.Frame();
  EXPECT_EQ(stand_in::Logged().size(), 1u);
  EXPECT_FALSE(stage.garment.LastError.IsEmpty());
  EXPECT_FALSE(stage.garment.vertices[0] != before);

  std::vector<FTransform> moved;
  for (const FTransform& bone : skeleton.binds) {
    moved.push_back({bone.GetRotation(), bone.GetTranslation() + FVector(50, 0, 0)});
  }
  stage.Pose(moved);
  stage.garment.visible = false;
  stage.garment.Jump();
  stage.Frame();
  EXPECT_FALSE(stage.garment.vertices[0] != before);
  stage.garment.visible = true;
  stage.garment.ResetCloth();
  stage.garment.Wind = {0, 0, 20000};  // 200 m/s: refused, and the frame is drawn all the same
  stand_in::Logged().clear();
  for (int f = 0; f < 3; ++f) stage.Frame();
  EXPECT_EQ(stand_in::Logged().size(), 1u);
  EXPECT_TRUE(stage.garment.LastError.IsEmpty());
  EXPECT_NEAR(stage.garment.vertices[0].X, before.X + 50, 10);

  stage.character.parent = nullptr;
  stage.character.mesh = nullptr;  // the character leaves
  stage.Frame();
  EXPECT_FALSE(stage.garment.IsDressed());
  EXPECT_EQ(stage.garment.GetNumSections(), 0);
  stage.garment.EndPlay(EEndPlayReason::Destroyed);
}

TEST(UnrealComponentTest, FactoryImportsModels) {
  const std::vector<uint8_t> bytes = ReadBytes(model_path);
  UDClothModelFactory factory;
  FFeedbackContext warn;
  const auto import = [&](size_t size) {
    const uint8* first = bytes.data();
    return std::unique_ptr<UObject>(factory.FactoryCreateBinary(factory.SupportedClass, nullptr, FName(TEXT("Skirt")),
                                                                RF_NoFlags, nullptr, TEXT("dcloth"), first,
                                                                first + size, &warn));
  };
  const std::unique_ptr<UObject> asset = import(bytes.size());
  UDClothModel* const model = Cast<UDClothModel>(asset.get());
  ASSERT_NE(model, nullptr);
  FString error;
  const auto opened = model->Open(error);
  ASSERT_NE(opened, nullptr);
  EXPECT_EQ(model->Open(error), opened);
  EXPECT_EQ(opened->info().vertex_count, Opened(bytes)->info().vertex_count);
  stand_in::Logged().clear();
  EXPECT_EQ(import(bytes.size() / 2), nullptr);
  EXPECT_EQ(stand_in::Logged().size(), 1u);
}

}  // namespace
}  // namespace dcloth::testing

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  if (argc != 4) return 2;
  dcloth::testing::model_path = argv[1];
  dcloth::testing::sequence_path = argv[2];
  dcloth::testing::run_path = argv[3];
  return RUN_ALL_TESTS();
}
