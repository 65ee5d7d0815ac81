// What reads artists' files hands over numbers and names of all kinds; what training and sequences get of it is sound,
// or refused by name.
#include <gtest/gtest.h>

#include <cmath>

#include "converter/error.h"
#include "tools/character/skeleton.h"
#include "tools/character/skinned_body.h"

namespace dcloth::tools {
namespace {

Eigen::Matrix4d Moved(double y) {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix(1, 3) = y;
  return matrix;
}

// Three nodes above one another, a metre apart; a triangle held by the upper two; the uppermost moves for a second.
CharacterFile Character() {
  CharacterFile file;
  file.path = "character";
  file.format = "FBX";
  file.upright.setIdentity();
  const char* const names[] = {"Root", "Hips", "Chest"};
  for (int32_t i = 0; i < 3; ++i) {
    file.nodes.push_back({names[i], i - 1, Moved(i == 0 ? 0 : 1), {}, false});
    if (i > 0) file.nodes.back().bind = Moved(i);
  }
  SkinnedMesh body;
  body.name = "Body";
  body.positions = {{0, 1, 0}, {1, 1, 0}, {0, 2, 0}};
  body.triangles = {0, 1, 2};
  body.influences = {{0, 1, 1.0f}, {1, 1, 0.25f}, {1, 2, 0.75f}, {2, 2, 3.0f}};
  file.meshes.push_back(body);
  CharacterClip clip;
  clip.name = "go";
  clip.last_seconds = 1;
  clip.channels.push_back({.node = 2, .positions = {.keys = {{0, {0, 1, 0}}, {1, {0, 2, 0}}}}});
  file.clips.push_back(std::move(clip));
  return file;
}

SkinnedBody BodyOf(const CharacterFile& file, const JointMap& map = {}) {
  return SkinnedBodyOf(file, {}, SkeletonOf(file, map, {}, {}));
}

ClipMatrices ClipOf(const CharacterFile& file, double fps = 2) {
  const Skeleton skeleton = SkeletonOf(file, {}, {}, {});
  return SampleClip(file, file.clips.front(), skeleton, Retarget(file, skeleton, {}), fps);
}

template <typename Work>
std::string Refusal(const Work& work) {
  try {
    work();
  } catch (const converter::Error& error) {
    return error.what();
  }
  return "nothing was refused";
}

void ExpectWords(const std::string& text, std::initializer_list<const char*> words) {
  for (const char* word : words) EXPECT_NE(text.find(word), std::string::npos) << word << " in: " << text;
}

TEST(CharacterTest, BodyHasSharesOfItsJoints) {
  const SkinnedBody body = BodyOf(Character());
  EXPECT_EQ(body.weights, (std::vector<float>{1, 0, 0.25f, 0.75f, 0, 1}));
  EXPECT_EQ(body.positions, (std::vector<float>{0, 1, 0, 1, 1, 0, 0, 2, 0}));
  EXPECT_EQ(body.parents, (std::vector<int32_t>{-1, 0}));
  EXPECT_EQ(body.faces, (std::vector<int32_t>{0, 1, 2}));
  EXPECT_EQ(body.bind.size(), 32u);
  EXPECT_EQ(body.bind[16 + 7], 2.0f);
}

TEST(CharacterTest, ClipIsSampledFromFirstKeyToLast) {
  const ClipMatrices clip = ClipOf(Character());
  ASSERT_EQ(clip.frame_count, 3u);
  ASSERT_EQ(clip.values.size(), 3u * 2 * 16);
  for (size_t f = 0; f < 3; ++f) {
    EXPECT_EQ(clip.values[32 * f + 7], 1.0f);
    EXPECT_FLOAT_EQ(clip.values[32 * f + 16 + 7], 2.0f + 0.5f * static_cast<float>(f));
  }
}

// Once a write past the end of the weights.
TEST(CharacterTest, WeightsOfAStepOfABonesTransformAreRefused) {
  CharacterFile file = Character();
  file.nodes[2].name = "Chest_$AssimpFbx$_Rotation";
  file.nodes[2].helper = true;
  ExpectWords(Refusal([&] { BodyOf(file); }), {"'Body'", "'Chest_$AssimpFbx$_Rotation', which is no joint", "--mesh"});
}

TEST(CharacterTest, MapsThatCallTwoNodesAlikeAreRefused) {
  for (const JointMap& map : {JointMap{{"Chest", "Hips"}}, JointMap{{"Hips", "Chest"}}}) {
    ExpectWords(Refusal([&] { BodyOf(Character(), map); }), {"the nodes 'Hips' and 'Chest'", "--map"});
  }
  EXPECT_EQ(BodyOf(Character(), {{"Chest", "Hips"}, {"Hips", "Chest"}}).parents, (std::vector<int32_t>{-1, 0}));
}

TEST(CharacterTest, SkeletonsBeyondAnyNumberAreRefused) {
  for (const double far : {1e300, std::nan("")}) {
    CharacterFile file = Character();
    file.nodes[1].bind = Moved(far) * Moved(far) * 1e300;
    for (const char* unit : {"", "m"}) {
      ExpectWords(Refusal([&] { SkeletonOf(file, {}, {}, {unit, ""}); }), {"out of range at joint 'Hips' at rest"});
    }
  }
}

TEST(CharacterTest, BodiesBeyondFloatAreRefused) {
  CharacterFile file = Character();
  file.meshes[0].positions[1].x() = 1e39;
  ExpectWords(Refusal([&] { BodyOf(file); }), {"out of range at a vertex of mesh 'Body'", "damaged"});
  file = Character();
  file.nodes[2].bind = Moved(1e39);
  ExpectWords(Refusal([&] {
                SkinnedBodyOf(file, {}, SkeletonOf(file, {}, {}, {"m", ""}));
              }),
              {"out of range at joint 'Chest'"});
}

TEST(CharacterTest, ClipsBeyondFloatAreRefused) {
  CharacterFile file = Character();
  file.clips[0].channels[0].positions.keys[1].second.y() = 4e38;
  ExpectWords(Refusal([&] { ClipOf(file); }), {"out of range at joint 'Chest', frame 2"});
}

TEST(CharacterTest, SequencesBeyondFourGigabytesAreRefused) {
  CharacterFile file = Character();
  file.clips[0].last_seconds = 86400;
  ExpectWords(Refusal([&] { ClipOf(file, 1000); }), {"86400 s at 1000 Hz", "4 GB", "--fps"});
}

}  // namespace
}  // namespace dcloth::tools
