#include "solver.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "order.h"

namespace cloth_solver {
namespace {

template <int K>
using Number = std::integral_constant<int, K>;

constexpr int kEvery = 4;            // steps between updates of normals and smoothed velocities
constexpr int kLayersEvery = 3;      // steps from one look at whether to search for layers that meet to the next
constexpr float kOpposed = -0.3f;    // cosine between two ways out, below which they oppose each other

std::vector<uint32_t> Touches(const cloth_solver_problem& p) {
  std::vector<uint32_t> out(p.vertices, ~0u);
  if (p.cloth_part) std::copy(p.cloth_part, p.cloth_part + p.vertices, out.begin());
  for (int32_t k = 0; k < p.pinned; ++k) out[p.pin[k]] = 0;
  return out;
}

}  // namespace

Solver::Solver(const cloth_solver_problem& p)
    : problem_(p), settings_(p.settings), dt_(p.settings.frame_seconds / static_cast<float>(p.settings.steps)),
      spare_(p.vertices), padded_((p.vertices + kLanes) / kLanes * kLanes),
      mesh_(MakeMesh(p.vertices, p.faces, p.face, p.pattern, p.bend_scale, p.crease,
                     {p.settings.stretch, p.settings.bias, p.settings.bend})),
      pins_(p.pin, p.pin + p.pinned), touches_(Touches(p)),
      body_(p.body_vertices, p.body_faces, p.body_face, p.body_part, p.body_parts, touches_),
      layers_(mesh_, p.vertices), inverse_mass_(padded_), drag_normal_(padded_), drag_tangent_(padded_), x_(padded_),
      before_(padded_), v_(padded_), normals_(padded_), smoothed_(padded_), pin_from_(p.pinned), pin_to_(p.pinned),
      pushed_(p.vertices) {
  for (int32_t i = 0; i < p.vertices; ++i) {
    const float density = settings_.density * (p.mass_scale ? p.mass_scale[i] : 1.0f), mass = density * mesh_.area[i];
    inverse_mass_[i] = mass > 0 ? 1 / mass : 0;
    const float pressure = 0.5f * settings_.air_density / std::max(density, 1e-6f);
    drag_normal_[i] = settings_.drag_normal * pressure, drag_tangent_[i] = settings_.drag_tangent * pressure;
  }
  for (int32_t pin : pins_) inverse_mass_[pin] = 0;
  constexpr float kLoose = 1e9f;
  tethers_.assign(padded_ / kLanes, {Floats{} + kLoose, {}});
  const std::vector<Tether> tethers = cloth_solver::Tethers(mesh_, p.vertices, pins_);
  for (int32_t i = 0; i < p.vertices; ++i) {
    if (tethers[i].pin < 0 || inverse_mass_[i] == 0) continue;
    tethers_[i / kLanes].most[i % kLanes] = settings_.tether * tethers[i].length;
    tethers_[i / kLanes].pin[i % kLanes] = tethers[i].pin;
  }
  MakeSprings();
  MakeHinges();
  origin_ = {p.origin[0], p.origin[1], p.origin[2]};
  for (int32_t i = 0; i < p.vertices; ++i) x_[i] = ToPoint(At(p.start, 0, 0, i));
  before_ = x_;
}

void Solver::MakeSprings() {
  std::vector<Edge> free;
  for (const Edge& e : mesh_.edges)
    if (inverse_mass_[e.a] + inverse_mass_[e.b] > 0) free.push_back(e);
  const auto blocks = Blocks(static_cast<int32_t>(free.size()), problem_.vertices,
                             [&](int32_t k) { return std::array<int32_t, 2>{free[k].a, free[k].b}; });
  const float shortening = 1 / std::max(settings_.compression, 1e-6f);
  for (const Block& block : blocks) {
    Springs s = {};
    s.a.fill(OffsetOf(spare_)), s.b.fill(OffsetOf(spare_));
    for (int k = 0; k < kLanes && block[k] >= 0; ++k) {
      const Edge& e = free[block[k]];
      s.a[k] = OffsetOf(e.a), s.b[k] = OffsetOf(e.b), s.rest[k] = e.rest;
      s.weight_a[k] = inverse_mass_[e.a], s.weight_b[k] = inverse_mass_[e.b];
      const float both = s.weight_a[k] + s.weight_b[k], yield = 1 / (e.stiffness * dt_ * dt_);
      s.longer[k] = 1 / (both + yield), s.shorter[k] = 1 / (both + shortening * yield);
    }
    springs_.push_back(s);
  }
}

// Creases first. A quadratic energy's step is linear: how far it moves each vertex is known beforehand.
void Solver::MakeHinges() {
  const float per_squared = 1 / (dt_ * dt_);
  for (const bool creased : {true, false}) {
    std::vector<Hinge> some;
    for (const Hinge& h : mesh_.hinges)
      if ((h.rest != 0) == creased) some.push_back(h);
    const auto blocks = Blocks(static_cast<int32_t>(some.size()), problem_.vertices,
                               [&](int32_t k) { return some[k].v; });
    for (const Block& block : blocks) {
      Hinges own = {};
      Creases at_rest = {};
      for (auto& v : own.v) v.fill(OffsetOf(spare_));
      at_rest.a.fill(spare_), at_rest.b.fill(spare_);
      for (int lane = 0; lane < kLanes && block[lane] >= 0; ++lane) {
        const Hinge& h = some[block[lane]];
        float total = h.compliance * per_squared;
        for (int m = 0; m < 4; ++m) total += h.k[m] * h.k[m] * inverse_mass_[h.v[m]];
        for (int m = 0; m < 4; ++m) {
          own.k[m][lane] = h.k[m], own.move[m][lane] = -h.k[m] * inverse_mass_[h.v[m]] / total;
          own.v[m][lane] = OffsetOf(h.v[m]);
        }
        at_rest.a[lane] = h.v[0], at_rest.b[lane] = h.v[1], at_rest.rest[lane] = h.rest;
      }
      hinges_.push_back(own);
      if (creased) creases_.push_back(at_rest);
    }
  }
}

Vec Solver::At(const float* path, int32_t count, int32_t frame, int32_t i) const {
  const float* at = path + 3 * (static_cast<size_t>(frame) * count + i);
  return Vec{at[0], at[1], at[2]} - origin_;
}

void Solver::Frame(int32_t frame) {
  const cloth_solver_problem& p = problem_;
  const float* at = p.origin + 3 * static_cast<size_t>(frame - 1);
  const Vec origin{at[0], at[1], at[2]}, shift = origin - origin_;
  origin_ = origin;
  for (int32_t i = 0; i < p.vertices; ++i) x_[i] = ToPoint(ToVec(x_[i]) - shift);
  if (p.wind) {
    const float* wind = p.wind + 3 * static_cast<size_t>(frame - 1);
    wind_from_ = {wind[0], wind[1], wind[2]}, wind_to_ = {wind[3], wind[4], wind[5]};
  }
  const float* body = p.body_path + 3 * static_cast<size_t>(p.body_vertices) * static_cast<size_t>(frame - 1);
  body_.BeginFrame(body, body + 3 * static_cast<size_t>(p.body_vertices), origin_, settings_.frame_seconds);
  for (int32_t k = 0; k < p.pinned; ++k) {
    pin_from_[k] = At(p.pin_path, p.pinned, frame - 1, k);
    pin_to_[k] = At(p.pin_path, p.pinned, frame, k);
  }
  for (int s = 0; s < settings_.steps; ++s) Step(static_cast<float>(s + 1) / static_cast<float>(settings_.steps));
}

void Solver::Step(float t) {
  wind_ = Mix(wind_from_, wind_to_, t);
  if (step_ % kEvery == 0) {
    LookAtNormals();
    Damp();
  }
  if (settings_.layer_thickness > 0 && step_ % kLayersEvery == 0 && layers_.Due(x_)) layers_.Find(x_);
  ++step_;
  body_.MoveTo(t);
  Predict();
  for (size_t k = 0; k < pins_.size(); ++k) x_[pins_[k]] = ToPoint(Mix(pin_from_[k], pin_to_[k], t));
  Bend();
  Stretch();
  UpdateVelocities();
  if (settings_.layer_thickness > 0) layers_.Hold(&x_, &v_, inverse_mass_, settings_.layer_thickness);
  PushOut();
}

void Solver::LookAtNormals() {
  Normals(mesh_, x_, &normals_);
  for (Creases& creases : creases_) {
    for (int k = 0; k < kLanes; ++k) {
      const Vec outward = ToVec(normals_[creases.a[k]]) + ToVec(normals_[creases.b[k]]);
      creases.bent[k] = ToPoint(creases.rest[k] * Unit(outward));
    }
  }
}

// Gravity, and air at rest or in wind: force along the normal and along the cloth, each with the square of its speed,
// implicit so that it never turns the relative velocity round.
void Solver::Predict() {
  for (size_t i = 0; i < padded_; i += kLanes) {
    const Vecs x = Load(&x_[i]), old = Load(&v_[i]), n = Load(&normals_[i]);
    Store(x, &before_[i]);
    const Vecs relative = old - wind_;
    const Floats across = Dot(relative, n);
    const Vecs along = relative - across * n;
    const Floats a = LoadFloats(&drag_normal_[i]) * (across < 0.0f ? -across : across) * dt_;
    const Floats b = LoadFloats(&drag_tangent_[i]) * SquareRoot(Dot(along, along)) * dt_;
    Vecs v = old - (b / (1 + b)) * along - (a / (1 + a) * across) * n;
    v.y -= settings_.gravity * dt_;
    const Ints free = LoadFloats(&inverse_mass_[i]) > 0.0f;
    Store(Select(free, v, old), &v_[i]);
    Store(Select(free, x + dt_ * v, x), &x_[i]);
  }
}

// Hinges of a block share no vertex: their curvature vectors are summed side by side, two in a vector.
void Solver::Bend() {
  Point* const points = x_.data();
  for (size_t block = 0; block < hinges_.size(); ++block) {
    const Hinges& h = hinges_[block];
    const Creases* creases = block < creases_.size() ? &creases_[block] : nullptr;
    const auto pair = [&](auto number) {
      constexpr int k = decltype(number)::value;
      Floats corner[4], bent{};
      for (int m = 0; m < 4; ++m) {
        corner[m] = LoadPair(*PointAt(points, h.v[m][k]), *PointAt(points, h.v[m][k + 4]));
        bent += Spread<k>(h.k[m]) * corner[m];
      }
      if (creases != nullptr) bent -= LoadPair(creases->bent[k], creases->bent[k + 4]);
      for (int m = 0; m < 4; ++m)
        StorePair(corner[m] + Spread<k>(h.move[m]) * bent, PointAt(points, h.v[m][k]), PointAt(points, h.v[m][k + 4]));
    };
    pair(Number<0>{}), pair(Number<1>{}), pair(Number<2>{}), pair(Number<3>{});
  }
}

// All passes over the edges. Those of a block share no vertex, so their roots and quotients are taken side by side.
void Solver::Stretch() {
  Point* const points = x_.data();
  const Floats least = Floats{} + 1e-9f;
  for (int pass = 0; pass < settings_.stretch_passes; ++pass) {
    for (const Springs& s : springs_) {
      Floats a[4], b[4], d[4];
      for (int k = 0; k < 4; ++k) {
        a[k] = LoadPair(*PointAt(points, s.a[k]), *PointAt(points, s.a[k + 4]));
        b[k] = LoadPair(*PointAt(points, s.b[k]), *PointAt(points, s.b[k + 4]));
        d[k] = b[k] - a[k];
      }
      const Floats squared = SumOfEach(d[0] * d[0], d[1] * d[1], d[2] * d[2], d[3] * d[3]);
      const Floats length = SquareRoot(squared), share = squared < s.rest * s.rest ? s.shorter : s.longer;
      const Floats push = share - share * (s.rest / (length < least ? least : length));
      const Floats to_a = s.weight_a * push, to_b = s.weight_b * push;
      const auto pair = [&](auto number) {
        constexpr int k = decltype(number)::value;
        StorePair(a[k] + Spread<k>(to_a) * d[k], PointAt(points, s.a[k]), PointAt(points, s.a[k + 4]));
        StorePair(b[k] - Spread<k>(to_b) * d[k], PointAt(points, s.b[k]), PointAt(points, s.b[k + 4]));
      };
      pair(Number<0>{}), pair(Number<1>{}), pair(Number<2>{}), pair(Number<3>{});
    }
  }
}

// What is beyond its tether is drawn back first.
void Solver::UpdateVelocities() {
  const float per_second = 1 / dt_;
  for (size_t i = 0; i < padded_; i += kLanes) {
    Vecs x = Load(&x_[i]);
    const Tethers& tethers = tethers_[i / kLanes];
    const Vecs pin = Gather(x_, tethers.pin), from_pin = x - pin;
    const Floats squared = Dot(from_pin, from_pin);
    const Ints too_far = squared > tethers.most * tethers.most;
    x = Select(too_far, pin + (tethers.most / SquareRoot(squared)) * from_pin, x);
    const Vecs before = Load(&before_[i]);
    Vecs v = per_second * (x - before);
    const Floats speed = SquareRoot(Dot(v, v));
    const Ints too_fast = (speed > settings_.max_speed) & (LoadFloats(&inverse_mass_[i]) > 0.0f);
    v = Select(too_fast, (settings_.max_speed / speed) * v, v);
    x = Select(too_fast, before + dt_ * v, x);
    Store(v, &v_[i]);
    Store(x, &x_[i]);
  }
}

// Between two surfaces closer than twice the thickness cloth ends in the middle.
void Solver::TakeContact(int32_t part, int32_t i) {
  const Vec x = ToVec(x_[i]);
  const Contact contact = body_.Touch(part, i, x, settings_.thickness);
  if (!contact.near) return;
  Push& last = pushed_[i];
  const bool between = last.step == step_ && Dot(last.normal, contact.normal) < kOpposed;
  last = {step_, contact.normal};
  x_[i] = ToPoint(x + ((between ? 0.5f : 1.0f) * (settings_.thickness - contact.distance)) * contact.normal);
  const Vec relative = ToVec(v_[i]) - contact.velocity;
  const float across = Dot(relative, contact.normal);
  if (across >= 0) return;
  const Vec sliding = relative - across * contact.normal;
  const float speed = Length(sliding), least = -settings_.friction * across;
  v_[i] = ToPoint(contact.velocity + (speed > least ? 1 - least / speed : 0.0f) * sliding);
}

// Contacts move a vertex out of the body, take its approach velocity away and, by Coulomb's law, as much of its sliding
// as friction allows. The way out is no velocity of the cloth: where thigh and trunk both push, it would be flung away.
void Solver::PushOut() {
  for (int32_t i = 0; i < problem_.vertices; i += kLanes) {
    Vecs x = Load(&x_[i]);
    for (int32_t p = 0; p < body_.parts(); ++p) {
      const uint32_t near = Bits(body_.MayTouch(p, i / kLanes, x));
      if (near == 0) continue;
      ForEachBit(near, [&](int k) { TakeContact(p, i + k); });
      x = Load(&x_[i]);
    }
  }
}

void Solver::Damp() {
  const float share = 1 - std::exp(-settings_.damping * dt_ * kEvery);
  for (int32_t i = 0; i < problem_.vertices; ++i) {
    smoothed_[i] = v_[i];
    const int32_t first = mesh_.first[i], last = mesh_.first[i + 1];
    if (inverse_mass_[i] == 0 || first == last) continue;
    Vec sum{};
    for (int32_t k = first; k < last; ++k) sum += ToVec(v_[mesh_.neighbours[k]]);
    const Vec v = ToVec(v_[i]);
    smoothed_[i] = ToPoint(v + share * ((1 / static_cast<float>(last - first)) * sum - v));
  }
  v_.swap(smoothed_);
}

bool Solver::Write(const std::vector<int32_t>& given, float* out) const {
  for (int32_t i = 0; i < problem_.vertices; ++i) {
    const Vec x = ToVec(x_[i]), world = x + origin_;
    float* to = out + 3 * static_cast<size_t>(given[i]);
    to[0] = world.x, to[1] = world.y, to[2] = world.z;
    if (!(std::abs(x.x) < 100 && std::abs(x.y) < 100 && std::abs(x.z) < 100)) return false;
  }
  return true;
}

}  // namespace cloth_solver

int32_t cloth_solver_run(const cloth_solver_problem* problem, float* out) {
  const cloth_solver_problem& p = *problem;
  const auto within = [](const int32_t* index, int32_t count, int32_t limit) {
    return std::all_of(index, index + count, [limit](int32_t i) { return i >= 0 && i < limit; });
  };
  if (p.frames < 1 || p.vertices < 1 || p.faces < 1 || p.settings.steps < 1 || p.body_parts < 0 || p.body_parts > 32 ||
      !within(p.face, 3 * p.faces, p.vertices) || !within(p.pin, p.pinned, p.vertices) ||
      !within(p.body_face, 3 * p.body_faces, p.body_vertices) || !within(p.body_part, p.body_faces, p.body_parts))
    return 0;
  const cloth_solver::Ordered ordered(p);
  cloth_solver::Solver solver(ordered.problem());
  const size_t size = 3 * static_cast<size_t>(p.vertices);
  solver.Write(ordered.given(), out);
  for (int32_t frame = 1; frame < p.frames; ++frame) {
    solver.Frame(frame);
    if (!solver.Write(ordered.given(), out + size * frame)) return frame;
  }
  return p.frames;
}
