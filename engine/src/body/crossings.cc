#include "engine/src/body/crossings.h"

#include <cmath>
#include <cstdint>

#include "engine/src/body/near_faces.h"
#include "engine/src/body/spread_moves.h"
#include "engine/src/body/triangle_crossing.h"

namespace dcloth::engine {
namespace {

using format::BodyView;
using format::ModelView;

constexpr int kMostPushes = 8;
constexpr int kTrials = 3;             // pushes after which parts are given up that have not come half the way out
constexpr double kOver = 0.1;          // clearances beyond where nothing crosses
constexpr double kMostLift = 2;        // clearances, of a push
constexpr double kFurthest = 16;       // clearances, of all pushes together
constexpr uint8_t kMostTogether = 64;  // vertices of a part at first; more are in a tangle

constexpr double kWhole = 1 << 20;  // of a unit vector: integers sum up to the same in any order

// What the faces that a triangle crosses ask of it.
struct Push {
  int64_t out[3];  // sum of their normals, times kWhole
  double lift;

  void Join(Vec normal, double more) {
    out[0] += static_cast<int64_t>(kWhole * normal.x);
    out[1] += static_cast<int64_t>(kWhole * normal.y);
    out[2] += static_cast<int64_t>(kWhole * normal.z);
    lift = more > lift ? more : lift;
  }
  bool IsNone() const { return out[0] == 0 && out[1] == 0 && out[2] == 0; }
};

// Vertices of triangles that crossed are in the lists of `deep`: `starts` is where they were at first, `sums` a push:
// x, y, z of its direction and its lift; `patches` and `nearest` serve for parts.
class Uncrossing {
 public:
  Uncrossing(const ModelView& model, const CrossedBody& body, const DeepCloth& deep, float* moves,
             const Surface& surface, uint32_t* faces)
      : model_(model),
        body_(body),
        deep_(deep),
        moves_(moves),
        surface_(surface),
        near_(model.body, body.sites, body.lists, static_cast<float>(body.clearance)),
        faces_(faces) {}

  size_t Run() {
    for (size_t v = 0; v < model_.vertex_count; ++v) deep_.places[v] = kNotDeep;
    if (!Find([this](const uint16_t* face) { return IsNotAbove(face) && (IsLong(face) || CrossesBeside(face)); })) {
      return 0;
    }
    KeepSmallParts();
    for (int push = 1; push <= kMostPushes && found_ != 0; ++push) {
      Move();
      if (!Find([this](const uint16_t* face) { return HasMoved(face); })) break;
      if (push == kTrials) KeepPromisingParts();
    }
    KeepPartsOutside();
    return SpreadMoves(model_, deep_, found_, moves_, surface_);
  }

 private:
  // Lists what the triangles that `ask` is true for cross; returns whether they do.
  template <typename Ask>
  bool Find(Ask ask) {
    any_ = false;
    TriangleBatch batch;
    batch.count = 0;
    for (size_t t = 0; t < model_.triangle_count && *faces_ != 0; ++t) {
      const uint16_t* face = model_.faces + 3 * t;
      if (!ask(face)) continue;
      batch.faces[batch.count++] = face;
      if (batch.count == TriangleBatch::kMost) LookAt(&batch);
    }
    if (batch.count != 0) LookAt(&batch);
    return any_;
  }

  // False where the planes beside the corners lie between the triangle and the faces around.
  bool IsNotAbove(const uint16_t* face) const {
    for (size_t k = 0; k < 3; ++k) {
      const uint16_t site = body_.beside[face[k]];
      if (site == kNotNear) continue;
      const float* normal = body_.normals + size_t{3} * site;
      const float over = body_.sites.offsets[site] - static_cast<float>(body_.clearance);
      for (size_t i = 0; i < 3; ++i) {
        if (Dot(normal, surface_.PositionOf(face[i])) < over) return true;
      }
    }
    return false;
  }

  // Than the faces beside it: it may cross some that are not beside its corners.
  bool IsLong(const uint16_t* face) const {
    float longest = 0;
    for (size_t k = 0; k < 3; ++k) {
      const float *p = surface_.PositionOf(face[k]), *q = surface_.PositionOf(face[(k + 1) % 3]);
      const float edge[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]};
      const float squared = Dot(edge, edge);
      longest = squared > longest ? squared : longest;
    }
    for (size_t k = 0; k < 3; ++k) {
      const uint16_t site = body_.beside[face[k]];
      if (site != kNotNear && longest > 3 * body_.sites.slacks[site]) return true;
    }
    return false;
  }

  bool CrossesBeside(const uint16_t* face) const {
    const Triangle triangle = TriangleOf(face);
    const uint8_t bits = BitsOf(face);
    const BodyView& body = model_.body;
    Push push = {};
    for (size_t k = 0; k < 3; ++k) {
      const uint16_t site = body_.beside[face[k]];
      if (site == kNotNear) continue;
      for (uint32_t i = body.row_starts[site]; i < body.row_starts[site + 1]; ++i)
        LookAtFace(body.faces + size_t{3} * body.columns[i], triangle, bits, &push);
      if (!push.IsNone()) return true;
    }
    return false;
  }

  bool HasMoved(const uint16_t* face) const {
    for (size_t k = 0; k < 3; ++k) {
      const uint16_t place = deep_.places[face[k]];
      if (place != kNotDeep && deep_.nearest[place] != 0) return true;
    }
    return false;
  }

  Triangle TriangleOf(const uint16_t* face) const {
    Triangle triangle = {};
    for (size_t k = 0; k < 3; ++k) triangle.corners[k] = VecAt(surface_.PositionOf(face[k]));
    triangle.FillNormal();
    return triangle;
  }

  uint8_t BitsOf(const uint16_t* face) const {
    const uint8_t* classes = model_.body.touch_classes;
    if (classes == nullptr) return 0;
    return static_cast<uint8_t>(1u << classes[face[0]] | 1u << classes[face[1]] | 1u << classes[face[2]]);
  }

  void Take(uint32_t count) const { *faces_ -= count < *faces_ ? count : *faces_; }

  void LookAt(TriangleBatch* batch) {
    Take(near_.FindGroups(surface_, batch));
    for (size_t i = 0; i < batch->count && *faces_ != 0; ++i) {
      const uint16_t* face = batch->faces[i];
      const Triangle triangle = TriangleOf(face);
      const uint8_t bits = BitsOf(face);
      Push push = {};
      near_.Each(surface_, *batch, i, [&](const uint16_t* corners) { LookAtFace(corners, triangle, bits, &push); });
      if (push.IsNone()) continue;
      any_ = true;
      for (size_t k = 0; k < 3; ++k) Add(face[k], push);
    }
    batch->count = 0;
  }

  void LookAtFace(const uint16_t* corners, const Triangle& triangle, uint8_t bits, Push* push) const {
    const uint8_t* touched = model_.body.touched_by;
    if (bits != 0 && (touched[corners[0]] & touched[corners[1]] & touched[corners[2]] & bits) == 0) return;
    Take(1);
    Triangle skin = {};
    for (size_t k = 0; k < 3; ++k) skin.corners[k] = VecAt(body_.posed.positions + size_t{3} * corners[k]);
    Crossing crossing;
    if (!DoCross(triangle, &skin, &crossing)) return;
    const double length = body_.posed.outward * std::sqrt(Dot(skin.normal, skin.normal));
    const Vec out = (1 / length) * skin.normal;
    push->Join(out, LiftOf(crossing, triangle, out, length));
  }

  void Add(uint16_t vertex, const Push& push) {
    if (deep_.places[vertex] == kNotDeep) {
      if (found_ == kMostDeep) return;
      Clear(found_);
      for (size_t c = 0; c < 3; ++c) deep_.starts[3 * found_ + c] = surface_.PositionOf(vertex)[c];
      deep_.places[vertex] = static_cast<uint16_t>(found_);
      deep_.vertices[found_++] = vertex;
    }
    float* sum = deep_.sums + size_t{4} * deep_.places[vertex];
    for (size_t c = 0; c < 3; ++c) sum[c] += static_cast<float>(push.out[c]);
    const float lift = static_cast<float>(push.lift);
    sum[3] = lift > sum[3] ? lift : sum[3];
  }

  void Clear(size_t place) {
    for (size_t c = 0; c < 4; ++c) deep_.sums[4 * place + c] = 0;
  }

  bool Crosses(size_t place) const {
    const float* sum = deep_.sums + 4 * place;
    return Dot(sum, sum) > 0;
  }

  // `nearest` then tells which.
  void Move() {
    for (size_t i = 0; i < found_; ++i) {
      deep_.nearest[i] = Crosses(i) ? 1 : 0;
      if (deep_.nearest[i] == 0) continue;
      const Vec out = VecAt(deep_.sums + 4 * i);
      const double lift = static_cast<double>(deep_.sums[4 * i + 3]) + kOver * body_.clearance;
      const double most = kMostLift * body_.clearance;
      Put(i, VecAt(surface_.PositionOf(deep_.vertices[i])) +
                 ((lift < most ? lift : most) / std::sqrt(Dot(out, out))) * out);
      Clear(i);
    }
  }

  void Put(size_t place, Vec at) {
    float* position = surface_.PositionOf(deep_.vertices[place]);
    position[0] = static_cast<float>(at.x);
    position[1] = static_cast<float>(at.y);
    position[2] = static_cast<float>(at.z);
  }

  Vec StartOf(size_t place) const { return VecAt(deep_.starts + 3 * place); }
  Vec MoveSinceStart(size_t place) const { return VecAt(surface_.PositionOf(deep_.vertices[place])) - StartOf(place); }

  // Parts of the lists hang together in triangles; `patches` leads from a place to its part's root.
  void JoinParts() {
    for (size_t i = 0; i < found_; ++i) {
      deep_.patches[i] = static_cast<uint16_t>(i);
      deep_.nearest[i] = 0;
    }
    for (size_t t = 0; t < model_.triangle_count; ++t) {
      const uint16_t* face = model_.faces + 3 * t;
      uint16_t first = kNotDeep;
      for (size_t k = 0; k < 3; ++k) {
        const uint16_t place = deep_.places[face[k]];
        if (place != kNotDeep && first != kNotDeep) Join(first, place);
        first = first != kNotDeep ? first : place;
      }
    }
  }

  void Join(size_t a, size_t b) {
    const size_t x = RootOf(a), y = RootOf(b);
    deep_.patches[x < y ? y : x] = static_cast<uint16_t>(x < y ? x : y);
  }

  size_t RootOf(size_t place) const {
    while (deep_.patches[place] != place) place = deep_.patches[place] = deep_.patches[deep_.patches[place]];
    return place;
  }

  // Those of more than `most` in `nearest` of their roots leave the lists, back where they were.
  void DropParts(uint8_t most) {
    for (size_t i = 0; i < found_; ++i) {
      if (deep_.nearest[RootOf(i)] <= most) continue;
      Put(i, StartOf(i));
      deep_.places[deep_.vertices[i]] = kNotDeep;
    }
    size_t kept = 0;
    for (size_t i = 0; i < found_; ++i) {
      const uint16_t vertex = deep_.vertices[i];
      if (deep_.places[vertex] == kNotDeep) continue;
      deep_.places[vertex] = static_cast<uint16_t>(kept);
      deep_.vertices[kept] = vertex;
      for (size_t c = 0; c < 3; ++c) deep_.starts[3 * kept + c] = deep_.starts[3 * i + c];
      for (size_t c = 0; c < 4; ++c) deep_.sums[4 * kept + c] = deep_.sums[4 * i + c];
      ++kept;
    }
    found_ = kept;
  }

  void KeepSmallParts() {
    JoinParts();
    for (size_t i = 0; i < found_; ++i) {
      uint8_t* count = deep_.nearest + RootOf(i);
      *count = static_cast<uint8_t>(*count + (*count <= kMostTogether ? 1 : 0));
    }
    DropParts(kMostTogether);
  }

  void KeepPromisingParts() {
    constexpr uint8_t kEven = 128;  // as many vertices cross as have come out
    JoinParts();
    for (size_t i = 0; i < found_; ++i) deep_.nearest[i] = kEven;
    for (size_t i = 0; i < found_; ++i) {
      uint8_t* balance = deep_.nearest + RootOf(i);
      const int more = Crosses(i) ? (*balance < UINT8_MAX ? 1 : 0) : (*balance > 0 ? -1 : 0);
      *balance = static_cast<uint8_t>(*balance + more);
    }
    DropParts(kEven);
  }

  void KeepPartsOutside() {
    JoinParts();
    const double furthest = kFurthest * body_.clearance;
    for (size_t i = 0; i < found_; ++i) {
      const Vec move = MoveSinceStart(i);
      const bool outside = !Crosses(i) && Dot(move, move) <= furthest * furthest && *faces_ != 0;
      if (!outside) deep_.nearest[RootOf(i)] = 1;
    }
    DropParts(0);
  }

  const ModelView& model_;
  const CrossedBody& body_;
  const DeepCloth& deep_;
  float* moves_;
  const Surface& surface_;
  const NearFaces near_;
  uint32_t* faces_;
  size_t found_ = 0;
  bool any_ = false;
};

}  // namespace

size_t Uncross(const ModelView& model, const CrossedBody& body, const DeepCloth& deep, float* moves,
               const Surface& surface, uint32_t* faces) {
  uint32_t left = *faces / 2;  // the rest is for what was moved
  *faces -= left;
  const size_t moved = Uncrossing(model, body, deep, moves, surface, &left).Run();
  *faces += left;
  return moved;
}

}  // namespace dcloth::engine
