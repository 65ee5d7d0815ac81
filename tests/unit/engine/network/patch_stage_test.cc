// The patch stage against its formulas in double, and what every stage promises: the same bits however a tick is cut,
// saved and restored, and no pose that leaves a NaN behind.
#include "engine/src/network/patch_stage.h"

#include <cstring>
#include <random>

#include "engine/src/base/arithmetic.h"
#include "engine/src/network/displacement.h"
#include "engine/src/network/schedule.h"
#include "engine/src/time/idle.h"
#include "tests/unit/engine/all_finite.h"
#include "tests/unit/engine/model_builder.h"
#include "tests/unit/engine/state_fixture.h"

namespace dcloth::testing {
namespace {

using engine::Affine;
using engine::Cloth;
using format::PatchStageView;
using V3 = std::array<double, 3>;

V3 operator+(const V3& a, const V3& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
V3 operator-(const V3& a, const V3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
V3 operator*(double s, const V3& a) { return {s * a[0], s * a[1], s * a[2]}; }
double Dot(const V3& a, const V3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
V3 At(const double* p) { return {p[0], p[1], p[2]}; }
V3 Turn(const Affine& a, const V3& v) {
  V3 out;
  for (size_t r = 0; r < 3; ++r) out[r] = a.m[r][0] * v[0] + a.m[r][1] * v[1] + a.m[r][2] * v[2];
  return out;
}
V3 Shift(const Affine& a) { return {a.m[0][3], a.m[1][3], a.m[2][3]}; }
V3 Place(const Affine& a, const V3& v) { return Turn(a, v) + Shift(a); }

using Row = std::vector<double>;

Row Apply(const Linear& linear, const Row& x) {
  EXPECT_EQ(x.size(), linear.rows);
  Row y = linear.bias;
  for (size_t j = 0; j < x.size(); ++j) {
    for (size_t c = 0; c < y.size(); ++c) y[c] += x[j] * linear.weights[j * linear.columns + c];
  }
  return y;
}

// NETWORK.md, "Patch stage", word by word.
class PatchReference {
 public:
  explicit PatchReference(const Numbers& numbers)
      : numbers_(numbers),
        p_(numbers.patches),
        K_(numbers.spec.patches),
        R_(numbers.spec.patch_points),
        W_(numbers.spec.patch_width),
        S_(numbers.spec.patch_neighbours),
        M_(numbers.spec.sources),
        E_(numbers.spec.embedding) {}

  void Reset() { started_ = false; }

  // `e`: ticks since the last one; infinite after a jump.
  void Tick(const Affine* joints, const V3& hips_way, const V3& wind, double e) {
    if (started_) {
      for (std::vector<V3>* places : {&x1_, &x2_, &c1_, &c2_, &ends_}) {
        for (V3& place : *places) place = place - hips_way;
      }
    }
    const size_t points = K_ * R_;
    std::vector<V3> c(K_), b(points), ends(2 * p_.capsule_joints.size());
    std::vector<std::array<V3, 3>> Q(K_);
    for (size_t k = 0; k < K_; ++k) {
      const Affine& joint = joints[p_.joints[k]];
      const double* L = &p_.axes[9 * k];
      for (size_t a = 0; a < 3; ++a) {
        Q[k][a] = Turn(joint, {L[a], L[3 + a], L[6 + a]});
        for (size_t i = 0; i < a; ++i) Q[k][a] = Q[k][a] - Dot(Q[k][i], Q[k][a]) / Dot(Q[k][i], Q[k][i]) * Q[k][i];
      }
      c[k] = Place(joint, At(&p_.centres[3 * k]));
    }
    for (size_t g = 0; g < points; ++g) {
      b[g] = {};
      for (size_t i = 0; i < 4; ++i) {
        const Affine& joint = joints[p_.point_joints[4 * g + i]];
        const double* part = &p_.point_parts[4 * (4 * g + i)];
        b[g] = b[g] + Turn(joint, At(part)) + part[3] * Shift(joint);
      }
    }
    for (size_t i = 0; i < ends.size(); ++i)
      ends[i] = Place(joints[p_.capsule_joints[i / 2]], At(&p_.capsules[8 * (i / 2) + 3 * (i % 2)]));
    for (size_t i = 0; i < ends.size() / 2; ++i) {
      for (size_t j = 0; j < ends.size() / 2; ++j) {
        if (At(&p_.capsules[8 * i + 3]) == At(&p_.capsules[8 * j])) ends[2 * i + 1] = ends[2 * j];
      }
    }
    if (!started_) {
      u_.assign(points, V3{});
      x1_ = x2_ = b;
      c1_ = c2_ = c;
      ends_ = ends;
      h_.assign(K_, Row(W_));
      started_ = true;
    }
    const auto out = [&](size_t k, const V3& v) { return v[0] * Q[k][0] + v[1] * Q[k][1] + v[2] * Q[k][2]; };
    const auto in = [&](size_t k, const V3& v) {
      V3 inside;
      for (size_t a = 0; a < 3; ++a) inside[a] = Dot(Q[k][a], v) / Dot(Q[k][a], Q[k][a]);
      return inside;
    };
    e = std::max(e, 1.0);
    const bool jumped = std::isinf(e);
    std::vector<V3> ends_before(ends.size());
    for (size_t i = 0; i < ends.size(); ++i) ends_before[i] = ends[i] - 1 / e * (ends[i] - ends_[i]);
    for (size_t g = 0; g < points; ++g) {
      const V3 moved = 1 / e * x1_[g] + (1 - 1 / e) * (b[g] + out(g / R_, u_[g]));
      x2_[g] = jumped ? moved : moved - (x1_[g] - x2_[g]);
      x1_[g] = moved;
    }
    for (size_t k = 0; k < K_; ++k) {
      const V3 moved = c[k] - 1 / e * (c[k] - c1_[k]);
      c2_[k] = jumped ? moved : moved - (c1_[k] - c2_[k]);
      c1_[k] = moved;
    }
    x.assign(K_, {});
    for (size_t k = 0; k < K_; ++k) {
      Row& row = x[k];
      const auto add_points = [&](auto value) {
        for (size_t axis = 0; axis < 3; ++axis) {
          for (size_t r = 0; r < R_; ++r) row.push_back(value(k * R_ + r)[axis]);
        }
      };
      const auto add = [&](double scale, const V3& v) {
        for (const double value : in(k, v)) row.push_back(std::clamp(scale * value, -8.0, 8.0));
      };
      const auto clamped = [](const V3& v) {
        return V3{std::clamp(10 * v[0], -8.0, 8.0), std::clamp(10 * v[1], -8.0, 8.0), std::clamp(10 * v[2], -8.0, 8.0)};
      };
      add_points([&](size_t g) { return clamped(u_[g]); });
      add_points([&](size_t g) { return clamped(in(k, x1_[g] - b[g]) - u_[g]); });
      add_points([&](size_t g) { return clamped(in(k, x1_[g] - x2_[g])); });
      for (size_t limb = 0; limb < 2; ++limb) {
        std::vector<V3> normals(R_);
        Row distances(R_), speeds(R_);
        for (size_t r = 0; r < R_; ++r) {
          double nearest = INFINITY;
          for (size_t bone = 0; bone < 2; ++bone) {
            const size_t i = p_.limbs[4 * k + 2 * limb + bone];
            const double* radii = &p_.capsules[8 * i + 6];
            const V3 way = ends[2 * i + 1] - ends[2 * i], from = x1_[k * R_ + r] - ends[2 * i];
            const double at = std::clamp(Dot(from, way) / Dot(way, way), 0.0, 1.0);
            const V3 away = from - at * way;
            const double length = std::sqrt(Dot(away, away));
            const double d = length - ((1 - at) * radii[0] + at * radii[1]);
            if (!(d < nearest)) continue;
            nearest = d;
            const V3 start_motion = ends[2 * i] - ends_before[2 * i],
                     end_motion = ends[2 * i + 1] - ends_before[2 * i + 1];
            const V3 normal = 1 / length * away, motion = (1 - at) * start_motion + at * end_motion;
            const double near = std::exp(-std::max(d, 0.0) / 0.08);
            normals[r] = near * in(k, normal);
            distances[r] = 10 * std::clamp(d, -0.1, 0.3);
            speeds[r] = std::clamp(10 * near * Dot(motion, normal), -4.0, 4.0);
          }
        }
        add_points([&](size_t g) { return normals[g % R_]; });
        row.insert(row.end(), distances.begin(), distances.end());
        row.insert(row.end(), speeds.begin(), speeds.end());
      }
      for (size_t i = 4 * k; i < 4 * k + 4; ++i) {
        const size_t end = 2 * p_.limbs[i] + 1;
        add(2, ends[end] - c[k]);
        add(10, ends[end] - ends_before[end]);
      }
      add(1, {0, -1, 0});
      add(6, wind);
      add(20, c[k] - 2 * c1_[k] + c2_[k]);
      row.insert(row.end(), p_.embedding.begin() + k * E_, p_.embedding.begin() + (k + 1) * E_);
    }
    RunLayers();
    for (size_t k = 0; k < K_; ++k) {
      Row inputs = h_[k];
      inputs.insert(inputs.end(), x[k].begin(), x[k].end());
      const Row o = Apply(p_.out, inputs);
      for (size_t r = 0; r < R_; ++r) {
        V3& u = u_[k * R_ + r];
        for (size_t axis = 0; axis < 3; ++axis)
          u[axis] = std::clamp(0.1 * o[axis * R_ + r] + p_.keep[r] * u[axis], -0.8, 0.8);
      }
    }
    x2_ = x1_;
    c2_ = c1_;
    for (size_t g = 0; g < points; ++g) x1_[g] = b[g] + out(g / R_, u_[g]);
    c1_ = c;
    ends_ = ends;
  }

  // delta [n, 3]
  Row Displacement() const {
    Row delta(3 * numbers_.n, NAN);
    const size_t points = K_ * R_;
    // One product over all columns for each group; only its own are its vertices'.
    size_t column = 0;
    for (size_t g = 0; g < points; ++g) {
      Row sources;
      for (size_t m = 0; m < M_; ++m) {
        const V3& u = u_[p_.sources[g * M_ + m]];
        sources.insert(sources.end(), u.begin(), u.end());
      }
      const Row made = Apply(p_.map, sources);
      const size_t begin = p_.group_starts[g], count = p_.group_starts[g + 1] - begin;
      for (size_t i = 0; i < 3 * count; ++i) delta[size_t{3} * p_.vertices[begin + i / 3] + i % 3] = made[column + i];
      column += kernels::PaddedColumns(3 * count);
    }
    return delta;
  }

  std::vector<Row> x;  // inputs of the last tick
  const std::vector<V3>& u() const { return u_; }

 private:
  void RunLayers() {
    const auto relu = [](Row y) {
      for (double& value : y) value = std::max(value, 0.0);
      return y;
    };
    std::vector<Row> f(K_);
    for (size_t k = 0; k < K_; ++k) f[k] = relu(Apply(p_.enter, x[k]));
    for (size_t l = 0; l < p_.mix.size(); ++l) {
      const std::vector<Row> before = f;
      for (size_t k = 0; k < K_; ++k) {
        Row all = before[k];
        for (size_t n = 0; n < S_; ++n) {
          const Row& other = before[p_.near[(l * S_ + n) * K_ + k]];
          all.insert(all.end(), other.begin(), other.end());
        }
        const Row more = relu(Apply(p_.mix[l], all));
        for (size_t i = 0; i < more.size(); ++i) f[k][i] += more[i];
      }
    }
    const auto sigmoid = [](double v) { return 1 / (1 + std::exp(-v)); };
    for (size_t k = 0; k < K_; ++k) {
      const Row gx = Apply(p_.input_gates, f[k]), gh = Apply(p_.hidden_gates, h_[k]);
      for (size_t i = 0; i < W_; ++i) {
        const double r = sigmoid(gx[i] + gh[i]), z = sigmoid(gx[W_ + i] + gh[W_ + i]);
        const double q = std::tanh(gx[2 * W_ + i] + r * gh[2 * W_ + i]);
        h_[k][i] = (1 - z) * q + z * h_[k][i];
      }
    }
  }

  const Numbers& numbers_;
  const Patches& p_;
  const size_t K_, R_, W_, S_, M_, E_;
  bool started_ = false;
  std::vector<V3> u_, x1_, x2_, c1_, c2_, ends_;
  std::vector<Row> h_;
};

Cloth* Inside(OwnedCloth* cloth) { return reinterpret_cast<Cloth*>(cloth->get()); }

// A tick in one piece, `elapsed` ticks after the last one.
void RunTick(OwnedCloth* cloth, const std::vector<float>& pose, uint32_t stages, double elapsed = 1) {
  Cloth* const inside = Inside(cloth);
  engine::Stopwatch watch(nullptr);
  engine::SkinPose skin = {inside->skin_joints, {}};
  ASSERT_TRUE(engine::ReadPose(*inside->model, inside->rig, OwnedCloth::Pose(pose), inside->pose_now));
  engine::MakeSkinPose(*inside->model, inside->pose_now, &skin);
  engine::BeginTick(inside, skin, stages, elapsed, &watch);
  engine::ContinueTick(inside, UINT64_MAX, &watch);
}

std::vector<float> Displacement(OwnedCloth* cloth) {
  const Cloth& inside = *Inside(cloth);
  const float* delta = inside.displacement[inside.newest];
  return {delta, delta + 3 * inside.model->vertex_count};
}

V3 Hips(const Numbers& numbers, const std::vector<float>& pose) {
  const float* hips = pose.data() + 16 * numbers.hips;
  return {double{hips[3]}, double{hips[7]}, double{hips[11]}};
}

ModelSpec Small(format::DType precision) {
  ModelSpec spec;
  spec.precision = precision;
  spec.patches = 5;
  return spec;
}

ModelSpec Wide(format::DType precision) {
  ModelSpec spec = Small(precision);
  spec.patches = 7;
  spec.patch_points = 8;
  spec.patch_width = 40;
  spec.embedding = 0;
  spec.sources = 8;
  spec.rings = 20;
  spec.seed = 2;
  return spec;
}

std::vector<ModelSpec> Specs() {
  std::vector<ModelSpec> specs;
  for (const format::DType precision : {format::DType_F32, format::DType_F16, format::DType_I8}) {
    specs.push_back(Small(precision));
    specs.push_back(Wide(precision));
    ModelSpec alone = Small(precision);
    alone.patches = 2;
    alone.patch_points = 16;
    alone.rings = 18;
    alone.patch_neighbours = 0;
    alone.mixes = 1;
    alone.sources = 2;
    alone.patch_width = 8;
    specs.push_back(alone);
  }
  return specs;
}

class PatchStageTest : public ::testing::TestWithParam<ModelSpec> {
 protected:
  const TestModel model_ = BuildModel(GetParam());
  const OpenedModel opened_{model_};
  const format::ModelView& view_ = *reinterpret_cast<const format::ModelView*>(opened_.get());
  const PatchStageView& stage_ = view_.patch_stage;

  std::vector<float> Pose(double tick) const { return PoseAt(model_.numbers, tick / 30); }
};

// Every joint's axes, by a scale that is not the same along all of them.
void Shear(std::vector<float>* pose) {
  for (size_t joint = 0; joint < pose->size(); joint += 16) {
    for (size_t row = joint; row < joint + 12; row += 4) {
      float* const m = pose->data() + row;
      m[1] = 0.8f * m[1] + 0.3f * m[0];
      m[2] = 1.2f * m[2] - 0.2f * m[0];
    }
  }
}

// Walk, a skipped time, a jump, a level without the stage, the way back, and sheared joints. Floats of positions near a
// metre are 6e-8 apart and differences of them are inputs times 10 to 20: 1e-4 of inputs up to 8 and 2e-6 m of cloth
// are some tens of roundings, and far below what a wrong sign, frame or tick would do. 16-bit inputs of int8 layers are
// off by 1e-4.
TEST_P(PatchStageTest, FollowsTheFormulas) {
  const bool int8 = GetParam().precision == format::DType_I8;
  const PatchStageView& stage = stage_;
  for (const std::string& isa : UsableIsas()) {
    ASSERT_EQ(dcloth_isa_select(isa.c_str()), DCLOTH_OK);
    SCOPED_TRACE(isa);
    OwnedCloth cloth(opened_);
    PatchReference reference(model_.numbers);
    const Cloth& inside = *Inside(&cloth);
    V3 hips_before = {};
    double clip = 0, worst_x = 0, worst_u = 0, moved = 0;
    for (int tick = 0; tick < 14; ++tick, ++clip) {
      const double elapsed = tick == 4 ? 2.5 : tick == 6 ? 0.75 : 1;
      clip += elapsed - 1;
      std::vector<float> pose = Pose(clip);
      const bool jumps = tick == 8, flies = tick == 10;  // a jump that the host tells, and one that nobody does
      if (tick >= 8) pose = PoseAt(model_.numbers, (clip + 20) / 30, {tick < 10 ? 3.0 : 4.0, 1, -5});
      if (tick >= 12) Shear(&pose);
      const V3 wind = {0.5 * tick, 1, -2};
      const float host_wind[3] = {static_cast<float>(wind[0]), 1, -2};
      ASSERT_EQ(dcloth_cloth_set_wind(cloth.get(), host_wind, nullptr), DCLOTH_OK);
      const uint32_t stages = tick == 11 ? DCLOTH_STAGES_STATIC
                              : tick < 3 ? DCLOTH_STAGES_SKELETON
                                         : DCLOTH_STAGES_MESH;
      Inside(&cloth)->root.jumped = jumps;
      RunTick(&cloth, pose, stages, elapsed);
      const V3 hips = Hips(model_.numbers, pose), way = hips - hips_before;
      hips_before = hips;
      const std::vector<float> delta = Displacement(&cloth);
      if (stages == DCLOTH_STAGES_STATIC) {
        reference.Reset();
        EXPECT_EQ(delta, std::vector<float>(delta.size()));
        continue;
      }
      reference.Tick(inside.skin_joints, way, 1.0 / 30 * wind, jumps || flies ? INFINITY : elapsed);
      for (size_t k = 0; k < stage.patch_count; ++k) {
        const float* x = inside.patches.rows + k * engine::PatchRowFloats(stage) + stage.width;
        for (size_t i = 0; i < reference.x[k].size(); ++i) {
          const double error = std::abs(double{x[i]} - reference.x[k][i]);
          EXPECT_LT(error, 1e-4 + (int8 ? 1e-3 : 0))
              << "tick " << tick << " patch " << k << " input " << i << ": " << x[i];
          worst_x = std::max(worst_x, error);
        }
        for (size_t r = 0; r < stage.point_count; ++r) {
          for (size_t axis = 0; axis < 3; ++axis) {
            const size_t at = (k * 3 + axis) * stage.point_count + r;
            const double expected = reference.u()[k * stage.point_count + r][axis];
            worst_u = std::max(worst_u, std::abs(double{engine::PatchDisplacement(inside.patches)[at]} - expected));
            moved = std::max(moved, std::abs(expected));
          }
        }
      }
      EXPECT_LT(worst_u, int8 ? 1e-5 : 2e-6) << tick;
      const Row expected = reference.Displacement();
      for (size_t i = 0; i < delta.size(); ++i)
        ASSERT_NEAR(double{delta[i]}, expected[i], int8 ? 5e-5 : 1e-5) << "tick " << tick << " coordinate " << i;
      if (HasFailure()) break;
    }
    EXPECT_GT(moved, 0.01) << "nothing to see";
    RecordProperty("worst_x_" + isa, std::to_string(worst_x));
    RecordProperty("worst_u_um_" + isa, std::to_string(worst_u * 1e6));
  }
  dcloth_isa_select(nullptr);
}

// Begins a tick without running it.
void Begin(OwnedCloth* cloth, const std::vector<float>& pose, uint32_t stages) {
  Cloth* const inside = Inside(cloth);
  engine::Stopwatch watch(nullptr);
  engine::SkinPose skin = {inside->skin_joints, {}};
  ASSERT_TRUE(engine::ReadPose(*inside->model, inside->rig, OwnedCloth::Pose(pose), inside->pose_now));
  engine::MakeSkinPose(*inside->model, inside->pose_now, &skin);
  engine::BeginTick(inside, skin, stages, 1, &watch);
  std::swap(inside->pose_before, inside->pose_now);
}

constexpr uint32_t kPlan[] = {7, 7, 3, 7, 1, 7, 3, 7};

TEST_P(PatchStageTest, PortionsGiveTheSameBits) {
  for (const std::string& isa : UsableIsas()) {
    ASSERT_EQ(dcloth_isa_select(isa.c_str()), DCLOTH_OK);
    for (const uint64_t budget : {uint64_t{1}, uint64_t{2000000}, uint64_t{100000000}}) {
      OwnedCloth whole(opened_), cut(opened_);
      std::mt19937_64 random(budget);
      engine::Stopwatch watch(nullptr);
      for (int tick = 0; tick < 8; ++tick) {
        RunTick(&whole, Pose(tick), kPlan[tick]);
        Begin(&cut, Pose(tick), kPlan[tick]);
        uint64_t spent = 0;
        while (engine::TickInWork(*Inside(&cut))) {
          const uint64_t portion = std::uniform_int_distribution<uint64_t>(1, budget)(random);
          spent += engine::ContinueTick(Inside(&cut), portion, &watch);
        }
        EXPECT_EQ(spent, engine::TickCost(view_, kPlan[tick]));
        ASSERT_EQ(Displacement(&whole), Displacement(&cut)) << isa << " tick " << tick << " budget " << budget;
      }
    }
  }
  dcloth_isa_select(nullptr);
}

// Saved before and after each item, restored into memory that has lived: every byte of the state after that tick and
// the next one is the same.
TEST_P(PatchStageTest, AStateSavedAnywhereGoesOn) {
  OwnedCloth original(opened_);
  engine::Stopwatch watch(nullptr);
  size_t saves = 0;
  for (int tick = 0; tick < 8; ++tick) {
    Begin(&original, Pose(tick), kPlan[tick]);
    if (tick == 0) engine::ContinueTick(Inside(&original), UINT64_MAX, &watch);
    std::vector<StateBytes> states = {Save(&original)};
    while (engine::TickInWork(*Inside(&original))) {
      engine::ContinueTick(Inside(&original), 1, &watch);
      states.push_back(Save(&original));
    }
    const StateBytes after = Save(&original);
    OwnedCloth next(opened_);
    ASSERT_EQ(Restore(&next, after), DCLOTH_OK);
    RunTick(&next, Pose(tick + 1), DCLOTH_STAGES_MESH);
    OwnedCloth restored(opened_);
    for (const StateBytes& state : states) {
      dcloth_error error = EmptyError();
      ASSERT_EQ(Restore(&restored, state, 0, &error), DCLOTH_OK) << error.text;
      ASSERT_EQ(Save(&restored), state);
      engine::ContinueTick(Inside(&restored), UINT64_MAX, &watch);
      ASSERT_EQ(Save(&restored), after) << "tick " << tick << " item " << saves;
      RunTick(&restored, Pose(tick + 1), DCLOTH_STAGES_MESH);
      ASSERT_EQ(Displacement(&restored), Displacement(&next));
      ++saves;
    }
  }
  const size_t groups = stage_.patch_count * stage_.point_count;
  EXPECT_GT(saves, 6 * (stage_.patch_count + stage_.layer_count + 3 + groups / engine::kMapPoints));
}

// Scales of joints from nothing to a billion, then a sound pose: what is left of them is a place to fall from.
TEST_P(PatchStageTest, NoPoseLeavesANumberThatIsNone) {
  const std::vector<float> sound = Pose(3);
  std::mt19937 random(5);
  std::vector<std::vector<float>> poses = {sound, std::vector<float>(sound.size(), 0.0f),
                                           std::vector<float>(sound.size(), 1e9f)};
  for (const float scale : {0.0f, 1e-30f, 1e-6f, 1e-3f, -1.0f, 1e8f}) {
    poses.push_back(sound);
    for (size_t i = 0; i < sound.size(); ++i) poses.back()[i] *= i % 16 < 12 && i % 4 < 3 ? scale : 1.0f;
  }
  poses.push_back(sound);
  for (float& x : poses.back()) x = random() % 2 == 0 ? 1e9f : -1e9f;
  const PatchStageView& stage = stage_;
  for (const std::string& isa : UsableIsas()) {
    ASSERT_EQ(dcloth_isa_select(isa.c_str()), DCLOTH_OK);
    for (const std::vector<float>& wild : poses) {
      OwnedCloth cloth(opened_);
      const engine::PatchMemory& patches = Inside(&cloth)->patches;
      for (const std::vector<float>* pose : {&sound, &wild, &wild, &sound, &sound, &sound}) {
        RunTick(&cloth, *pose, DCLOTH_STAGES_MESH, pose == &wild ? 3 : 1);
        ASSERT_TRUE(AllFinite(Displacement(&cloth)));
        ASSERT_TRUE(AllFinite({patches.cloth, patches.cloth + engine::PatchClothFloats(stage)}));
        ASSERT_TRUE(AllFinite({patches.hidden, patches.hidden + stage.patch_count * stage.width}));
        const float* u = engine::PatchDisplacement(patches);
        for (size_t i = 0; i < 3 * size_t{stage.patch_count} * stage.point_count; ++i) ASSERT_LE(std::abs(u[i]), 0.8f);
      }
      ASSERT_EQ(cloth.Skin(sound, 1), DCLOTH_OK);
      ASSERT_TRUE(AllFinite(cloth.positions()));
    }
  }
  dcloth_isa_select(nullptr);
}

// Biases that push on in every tick.
TEST(PatchLimit, ClothStaysWhereItsInputsCanTell) {
  TestModel model = BuildModel(Small(format::DType_F32));
  const format::TensorT& bias = *model.tables->patch_stage->out->bias;
  std::fill_n(reinterpret_cast<float*>(model.tables->weights.data() + bias.offset), bias.shape[0], 9.0f);
  const OpenedModel opened(model);
  OwnedCloth cloth(opened);
  for (int tick = 0; tick < 4; ++tick) RunTick(&cloth, PoseAt(model.numbers, tick / 30.0), DCLOTH_STAGES_MESH);
  const float* u = engine::PatchDisplacement(Inside(&cloth)->patches);
  for (size_t i = 0; i < size_t{3} * model.numbers.spec.patches * model.numbers.spec.patch_points; ++i)
    EXPECT_EQ(u[i], 0.8f);
}

// A network that never rests by itself: each tick pushes its cloth on by the same way. Bodies that are still for long
// end that, whatever they are moved by afterwards begins it again, and no other body's cloth is held back.
TEST(PatchRest, ClothOfAStillBodyRests) {
  ModelSpec spec = Small(format::DType_F32);
  TestModel model = BuildModel(spec);
  const format::PatchStageT& tables = *model.tables->patch_stage;
  const auto fill = [&](const format::TensorT& tensor, size_t count, float value) {
    std::fill_n(reinterpret_cast<float*>(model.tables->weights.data() + tensor.offset), count, value);
  };
  const std::vector<uint32_t>& shape = tables.out->weights->shape;
  fill(*tables.out->weights, shape[0] * kernels::PaddedColumns(shape[1]), 0);
  fill(*tables.out->bias, tables.out->bias->shape[0], 0.01f);
  fill(*tables.keep, tables.keep->shape[0], 1);
  const OpenedModel opened(model);
  OwnedCloth cloth(opened);
  const auto moves = [&](const std::vector<float>& pose) {
    const float before = engine::PatchDisplacement(Inside(&cloth)->patches)[0];
    RunTick(&cloth, pose, DCLOTH_STAGES_MESH);
    return engine::PatchDisplacement(Inside(&cloth)->patches)[0] - before;
  };
  std::vector<float> pose = PoseAt(model.numbers, 0);
  const auto hold = [&] {
    float before = moves(pose);
    EXPECT_NEAR(before, 1e-3, 1e-6);
    for (int tick = 0; tick < 76; ++tick) {
      const float now = moves(pose);
      EXPECT_TRUE(tick < 44 ? std::abs(now - 1e-3f) < 1e-6f : now <= before) << tick;
      before = now;
    }
    // Features that went on would throw the cloth when the body moves again.
    const engine::PatchMemory& patches = Inside(&cloth)->patches;
    const std::vector<float> hidden(patches.hidden, patches.hidden + spec.patches * spec.patch_width);
    for (int tick = 0; tick < 20; ++tick) EXPECT_EQ(moves(pose), 0);
    EXPECT_TRUE(std::equal(hidden.begin(), hidden.end(), patches.hidden));
  };
  hold();
  for (size_t joint = 0; joint < pose.size() / 16; ++joint) pose[16 * joint + 3] += 1e-3f;
  hold();
  // As slow as a breath.
  for (int tick = 0; tick < 100; ++tick) {
    for (size_t joint = 0; joint < pose.size() / 16; ++joint) pose[16 * joint + 7] += 1e-4f;
    EXPECT_NEAR(moves(pose), 1e-3, 1e-6) << tick;
  }
  // A limb that creeps by less a tick than counts as motion gets ahead of its cloth by no more than that.
  hold();
  int moved = 0;
  for (int tick = 0; tick < 300; ++tick) {
    for (size_t joint = 0; joint < pose.size() / 16; ++joint) pose[16 * joint + 7] += 3e-5f;
    moved += moves(pose) != 0 ? 1 : 0;
  }
  EXPECT_GE(moved, 250);
  const float breeze[3] = {0.1f, 0, 0};
  ASSERT_EQ(dcloth_cloth_set_wind(cloth.get(), breeze, nullptr), DCLOTH_OK);
  for (int tick = 0; tick < 100; ++tick) EXPECT_NEAR(moves(pose), 1e-3, 1e-6) << tick;
}

// A character that stands still lets the cloth freeze; a breath of wind wakes it.
TEST_P(PatchStageTest, FreezesAtRestAndWakesInTheWind) {
  constexpr float kSeconds = 1 / 30.0f;
  OwnedCloth cloth(opened_);
  const auto update = [&](double tick) {
    EXPECT_EQ(cloth.Update(Pose(tick), kSeconds, DCLOTH_STAGES_MESH, DCLOTH_FRAME_FREEZE_IDLE), DCLOTH_OK);
    return engine::IsFrozen(*Inside(&cloth));
  };
  for (int tick = 0; tick < 20; ++tick) ASSERT_FALSE(update(tick));
  int ticks = 0;
  while (!update(20) && ticks < 2000) ++ticks;
  ASSERT_LT(ticks, 2000);
  ASSERT_GE(ticks, static_cast<int>(engine::kIdleTicks) - 1);
  EXPECT_TRUE(update(20));
  const float wind[3] = {3, 0, 0};
  ASSERT_EQ(dcloth_cloth_set_wind(cloth.get(), wind, nullptr), DCLOTH_OK);
  EXPECT_FALSE(update(20));
}

std::string NameOf(const ::testing::TestParamInfo<ModelSpec>& test) {
  return std::string(format::EnumNameDType(test.param.precision)) + "_points_" +
         std::to_string(test.param.patch_points);
}

INSTANTIATE_TEST_SUITE_P(Every, PatchStageTest, ::testing::ValuesIn(Specs()), NameOf);

// Integers, and floats that are not fused: one motion on all of them.
TEST(PatchPrecision, IntegersGiveTheSameBitsOnEveryInstructionSet) {
  for (const ModelSpec& spec : {Small(format::DType_I8), Wide(format::DType_I8)}) {
    const TestModel model = BuildModel(spec);
    const OpenedModel opened(model);
    std::vector<std::vector<float>> first;
    for (const std::string& isa : UsableIsas()) {
      ASSERT_EQ(dcloth_isa_select(isa.c_str()), DCLOTH_OK);
      OwnedCloth cloth(opened);
      for (size_t tick = 0; tick < 20; ++tick) {
        RunTick(&cloth, PoseAt(model.numbers, static_cast<double>(tick) / 30), DCLOTH_STAGES_MESH);
        if (first.size() == tick) first.push_back(Displacement(&cloth));
        ASSERT_EQ(Displacement(&cloth), first[tick]) << isa << " tick " << tick;
      }
    }
  }
  EXPECT_GT(UsableIsas().size(), 1u);
  dcloth_isa_select(nullptr);
}

// What the sizes of the state are made of is the model's, whichever identity it has.
TEST(PatchState, AnotherModelsIsRefused) {
  ModelSpec spec = Small(format::DType_F32);
  const TestModel model = BuildModel(spec);
  ++spec.patches;
  const OpenedModel opened(model), other(BuildModel(spec));
  OwnedCloth cloth(opened), taker(other);
  RunTick(&cloth, PoseAt(model.numbers, 0), DCLOTH_STAGES_MESH);
  dcloth_error error = EmptyError();
  for (const uint32_t flags : {0u, uint32_t{DCLOTH_RESTORE_OTHER_MODEL}}) {
    EXPECT_EQ(Restore(&taker, Save(&cloth), flags, &error), DCLOTH_ERROR_MODEL);
    EXPECT_EQ(std::string(error.text).find("patch_shape: found "), 0u) << error.text;
  }
}

}  // namespace
}  // namespace dcloth::testing
