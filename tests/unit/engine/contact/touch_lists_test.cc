// Classes as lists: what a class's groups hold against the masks that the file gives.
#include "engine/src/contact/touch_lists.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <vector>

#include "kernels/nearest/nearest.h"

namespace dcloth::testing {
namespace {

using engine::TouchClass;

// A body of b vertices and a garment of n at random places, with random classes and masks.
struct Garment {
  Garment(size_t n, size_t b, unsigned masks, std::mt19937* random) : classes(n), touched_by(b) {
    std::uniform_real_distribution<float> place(-1, 1);
    for (size_t i = 0; i < 3 * n; ++i) cloth.push_back(place(*random));
    for (size_t i = 0; i < 3 * b; ++i) skin.push_back(place(*random));
    for (uint8_t& c : classes) c = static_cast<uint8_t>((*random)() % format::kMaxTouchClasses);
    for (uint8_t& mask : touched_by) mask = static_cast<uint8_t>((*random)() % masks);
    model.template_positions = cloth.data();
    model.vertex_count = static_cast<uint32_t>(n);
    model.body.positions = skin.data();
    model.body.vertex_count = static_cast<uint32_t>(b);
    model.body.touch_classes = classes.data();
    model.body.touched_by = touched_by.data();
    engine::Arena counted(nullptr);
    engine::PlaceTouchLists(model, &counted);
    memory.resize(counted.size() / sizeof(uint64_t) + 1, ~uint64_t{0});
    engine::Arena arena(memory.data());
    lists = engine::PlaceTouchLists(model, &arena);
    engine::FillTouchLists(model, lists);
  }

  std::vector<float> cloth, skin;
  std::vector<uint8_t> classes, touched_by;
  std::vector<uint64_t> memory;
  format::ModelView model = {};
  engine::TouchLists lists;
};

TEST(TouchListsTest, EachClassHasItsVerticesAndWhatItTouches) {
  std::mt19937 random(3);
  for (const unsigned masks : {256u, 40u, 3u, 1u}) {
    const Garment garment(500, 2000, masks, &random);
    const format::BodyView& body = garment.model.body;
    size_t most = 0, vertices = 0;
    for (size_t c = 0; c < engine::ClassCount(garment.model); ++c) {
      const TouchClass touch = engine::ClassAt(garment.model, garment.lists, c);
      std::multiset<size_t> cloth;
      for (size_t i = 0; i < touch.vertex_count; ++i) cloth.insert(touch.vertices[i]);
      std::set<size_t> skin;
      for (size_t g = 0; g < touch.group_count; ++g) {
        const size_t first = touch.groups[g] * kernels::kNearestGroup;
        for (size_t k = 0; k < kernels::kNearestGroup; ++k) {
          const size_t vertex = engine::BodyVertexAt(body, garment.lists, first + k);
          ASSERT_EQ(body.touched_by[vertex], body.touched_by[engine::BodyVertexAt(body, garment.lists, first)]);
          skin.insert(vertex);
        }
      }
      std::multiset<size_t> expected_cloth;
      for (size_t i = 0; i < garment.classes.size(); ++i) {
        if (garment.classes[i] == c) expected_cloth.insert(i);
      }
      std::set<size_t> expected_skin;
      for (size_t i = 0; i < body.vertex_count; ++i) {
        if ((garment.touched_by[i] >> c & 1) != 0) expected_skin.insert(i);
      }
      EXPECT_EQ(cloth, expected_cloth) << masks << " masks, class " << c;
      EXPECT_EQ(skin, expected_skin) << masks << " masks, class " << c;
      EXPECT_EQ(touch.bit, 1u << c);
      most = std::max(most, touch.group_count);
      vertices += touch.vertex_count;
    }
    EXPECT_EQ(most, engine::MostGroupCount(body));
    EXPECT_EQ(vertices, garment.classes.size());
  }
}

// Since 1.5 the file holds what is made for older ones, and no instance has a copy.
TEST(TouchListsTest, OrdersOfTheFileAreUsed) {
  std::mt19937 random(9);
  Garment garment(500, 2000, 40, &random);
  const size_t without = garment.memory.size();
  std::vector<uint16_t> order(garment.lists.order, garment.lists.order + 500);
  std::vector<uint16_t> sites(
      garment.lists.sites, garment.lists.sites + kernels::kNearestGroup * engine::SiteGroupCount(garment.model.body));
  const std::vector<uint32_t> starts(garment.lists.order_starts, garment.lists.order_starts + 9);
  garment.model.body.garment_order = order.data();
  garment.model.body.sites = sites.data();
  engine::Arena arena(garment.memory.data());
  const engine::TouchLists lists = engine::PlaceTouchLists(garment.model, &arena);
  engine::FillTouchLists(garment.model, lists);
  EXPECT_EQ(lists.order, order.data());
  EXPECT_EQ(lists.sites, sites.data());
  EXPECT_EQ(lists.made_order, nullptr);
  EXPECT_EQ(lists.made_sites, nullptr);
  EXPECT_EQ(std::vector<uint32_t>(lists.order_starts, lists.order_starts + 9), starts);
  EXPECT_LT(arena.size() / sizeof(uint64_t), without);
}

// Masks of all kinds leave the most groups unfilled.
TEST(TouchListsTest, TheLargestBodyFitsTheKernel) {
  std::mt19937 random(4);
  const Garment garment(1, format::kMaxBodyVertices, 256, &random);
  EXPECT_LE(engine::SiteGroupCount(garment.model.body), kernels::kMaxNearestGroups);
  EXPECT_LE(format::kMaxBodyVertices / kernels::kNearestGroup + 255, kernels::kMaxNearestGroups);
}

}  // namespace
}  // namespace dcloth::testing
