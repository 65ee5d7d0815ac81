// A body for test models, and the depth under it by brute force in double.
#ifndef DCLOTH_TESTS_UNIT_ENGINE_TEST_BODY_H_
#define DCLOTH_TESTS_UNIT_ENGINE_TEST_BODY_H_

#include <array>
#include <cstdint>
#include <vector>

#include "tests/unit/engine/model_builder.h"

namespace dcloth::testing {

using Point = std::array<double, 3>;

// A closed egg on the character's axis that two joints carry, [b, 3] at bind and what the file says of it.
struct EggBody {
  std::vector<float> positions;
  std::vector<uint8_t> joints;  // [b, 2]
  std::vector<float> weights;   // [b, 2]
  std::vector<uint16_t> faces;  // [f, 3]
  double clearance = 0, reach = 0;
};

// Adds the body to the model's tables. b = rings * segments + 2.
EggBody AddBody(TestModel* model, uint32_t rings = 14, uint32_t segments = 20, float clearance = 0.002f,
                float reach = 1.0f);

// The egg as a trunk and inside it, after its vertices, an upright tube as an arm, open at both ends.
EggBody AddTrunkAndArm(TestModel* model, uint32_t rings, uint32_t segments, size_t* trunk_vertices);

// Which cloth touches which part: a class a garment vertex, a bit a class and body vertex.
void AddTouch(TestModel* model, const std::vector<uint8_t>& classes, const std::vector<uint8_t>& touched_by);

// The orders that the search wants, as the converter writes them: as since format 1.5.
void AddOrders(TestModel* model);

// World positions in the pose [joints, 16], in double: the bodies of every test are small enough to try all faces.
std::vector<Point> PoseBody(const EggBody& body, const Numbers& numbers, const std::vector<float>& pose);

// Distance to the closest of all faces, below 0 inside. The side is that of the angle-weighted normal at the closest
// point (Baerentzen and Aanaes, 2005), which the engine does not use.
double SignedDistance(const EggBody& body, const std::vector<Point>& posed, const Point& point);

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_ENGINE_TEST_BODY_H_
