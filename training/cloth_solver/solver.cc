#include "solver.h"

#include <algorithm>
#include <cmath>

namespace cloth_solver {
namespace {

constexpr float kGravity = 9.81f;
constexpr int kEvery = 4;            // steps between updates of normals and smoothed velocities
constexpr int kBraceRings = 12, kBraceDirections = 6;
constexpr int kStretchPasses = 2;    // braces pull at edges too: after one pass cloth over a lifted thigh is a tenth longer
constexpr float kMaxSpeed = 30.0f;   // m/s: what a contact may give a vertex at most

std::vector<Vec> Vecs(const float* from, int32_t count) {
  std::vector<Vec> out(count);
  for (int32_t i = 0; i < count; ++i) out[i] = {from[3 * i], from[3 * i + 1], from[3 * i + 2]};
  return out;
}

Vec Column(const float* hips, int c) { return {hips[c], hips[4 + c], hips[8 + c]}; }

}  // namespace

Solver::Solver(const cloth_solver_problem& p)
    : problem_(p), settings_(p.settings), dt_(p.settings.frame_seconds / static_cast<float>(p.settings.steps)),
      mesh_(MakeMesh(p.vertices, p.faces, p.face)),
      collider_(MakeMesh(p.body_vertices, p.body_faces, p.body_face),
                std::vector<uint32_t>(p.body_part, p.body_part + p.body_vertices), p.body_parts,
                p.cloth_part ? std::vector<uint32_t>(p.cloth_part, p.cloth_part + p.vertices) : std::vector<uint32_t>(),
                p.vertices),
      pins_(p.pin, p.pin + p.pinned), inverse_mass_(p.vertices), x_(Vecs(p.rest, p.vertices)), before_(x_),
      v_(p.vertices), smoothed_(p.vertices), touching_(p.vertices), slide_(p.vertices), slide_normal_(p.vertices) {
  std::vector<float> mass(p.vertices, 0);
  for (const auto& [a, b, c] : mesh_.faces) {
    const float third = settings_.density * Length(Cross(x_[b] - x_[a], x_[c] - x_[a])) / 6;
    mass[a] += third, mass[b] += third, mass[c] += third;
  }
  for (int32_t i = 0; i < p.vertices; ++i) inverse_mass_[i] = mass[i] > 0 ? 1 / mass[i] : 0;
  for (int32_t pin : pins_) inverse_mass_[pin] = 0;
  std::vector<Pair> braces = Braces(mesh_, x_, kBraceRings, kBraceDirections);
  for (auto [pairs, out] : {std::pair{&mesh_.edges, &stretch_}, std::pair{&mesh_.across, &bend_}, std::pair{&braces, &brace_}})
    for (const Pair& e : Interleave(*pairs, p.vertices))
      if (inverse_mass_[e.a] + inverse_mass_[e.b] > 0) out->push_back({e.a, e.b, Length(x_[e.a] - x_[e.b])});
  tethers_ = Tethers(mesh_, x_, pins_);
  origin_ = Column(p.hips, 3);
  for (Vec& x : x_) x -= origin_;
  before_ = x_;
}

Vec Solver::At(const float* path, int32_t count, int32_t frame, int32_t i) const {
  const float* at = path + 3 * (static_cast<size_t>(frame) * count + i);
  return Vec{at[0], at[1], at[2]} - origin_;
}

void Solver::Frame(int32_t frame) {
  const cloth_solver_problem& p = problem_;
  const float* hips = p.hips + 12 * static_cast<size_t>(frame);
  const Vec origin = Column(hips - 12, 3), shift = origin - origin_;
  origin_ = origin;
  for (Vec& x : x_) x -= shift;

  // Air that follows the hips: their velocity, and their turning as a small-angle vector.
  const float per_second = 1 / settings_.frame_seconds;
  air_velocity_ = (settings_.air_follows * per_second) * (Column(hips, 3) - origin);
  Vec turn{};
  for (int c = 0; c < 3; ++c) turn += 0.5f * Cross(Column(hips - 12, c), Column(hips, c));
  air_spin_ = (settings_.air_follows * per_second) * turn;
  up_from_ = Column(hips - 12, 1), up_to_ = Column(hips, 1);

  std::vector<Vec> from(p.body_vertices), to(p.body_vertices);
  for (int32_t b = 0; b < p.body_vertices; ++b) {
    from[b] = At(p.body_path, p.body_vertices, frame - 1, b);
    to[b] = At(p.body_path, p.body_vertices, frame, b);
  }
  float fastest = 0;
  for (const Vec& v : v_) fastest = std::max(fastest, Length(v));
  collider_.BeginFrame(std::move(from), std::move(to), settings_.frame_seconds, x_, fastest * settings_.frame_seconds);
  pin_from_.resize(p.pinned), pin_to_.resize(p.pinned);
  for (int32_t k = 0; k < p.pinned; ++k) {
    pin_from_[k] = At(p.pin_path, p.pinned, frame - 1, k);
    pin_to_[k] = At(p.pin_path, p.pinned, frame, k);
  }
  for (int s = 0; s < settings_.steps; ++s) Step(static_cast<float>(s + 1) / static_cast<float>(settings_.steps));
}

void Solver::Step(float t) {
  up_ = Unit(Mix(up_from_, up_to_, t));
  if (step_++ % kEvery == 0) {
    Normals(mesh_, x_, normals_);
    SmoothVelocities();
  }
  collider_.MoveTo(t);
  Predict();
  for (size_t k = 0; k < pins_.size(); ++k) x_[pins_[k]] = Mix(pin_from_[k], pin_to_[k], t);
  if (settings_.brace_stiffness > 0) Solve(brace_, 1 / settings_.brace_stiffness);
  Solve(bend_, 1 / settings_.bend_stiffness);
  for (int pass = 0; pass < kStretchPasses; ++pass) Solve(stretch_, settings_.stretch_compliance);
  HoldTethers();
  PushOut();
  UpdateVelocities();
}

void Solver::Predict() {
  const float normal = 1 - std::exp(-settings_.drag_normal * dt_), tangent = 1 - std::exp(-settings_.drag_tangent * dt_);
  for (size_t i = 0; i < x_.size(); ++i) {
    before_[i] = x_[i];
    if (inverse_mass_[i] == 0) continue;
    Vec& v = v_[i];
    const Vec wind = v - air_velocity_ - Cross(air_spin_, x_[i]);
    const Vec& n = normals_[i];
    v -= tangent * wind + ((normal - tangent) * Dot(wind, n)) * n;
    v.y -= kGravity * dt_;
    x_[i] += dt_ * v;
  }
}

void Solver::Solve(const std::vector<Distance>& constraints, float compliance) {
  const float softness = compliance / (dt_ * dt_);
  for (const Distance& c : constraints) {
    const float wa = inverse_mass_[c.a], wb = inverse_mass_[c.b];
    const Vec d = x_[c.b] - x_[c.a];
    const float length = Length(d);
    const float push = (length - c.rest) / ((wa + wb + softness) * std::max(length, 1e-9f));
    x_[c.a] += (wa * push) * d;
    x_[c.b] -= (wb * push) * d;
  }
}

void Solver::HoldTethers() {
  for (size_t i = 0; i < x_.size(); ++i) {
    if (inverse_mass_[i] == 0 || tethers_[i].pin < 0) continue;
    const Vec& pin = x_[tethers_[i].pin];
    const Vec d = x_[i] - pin;
    const float most = settings_.tether * tethers_[i].length, squared = Dot(d, d);
    if (squared > most * most) x_[i] = pin + (most / std::sqrt(squared)) * d;
    if (tethers_[i].length < problem_.yoke) {
      const float rise = Dot(x_[i] - pin, up_);
      if (rise > 0) x_[i] -= rise * up_;
    }
  }
}

void Solver::PushOut() {
  std::fill(touching_.begin(), touching_.end(), 0);
  for (int32_t p = 0; p < collider_.parts(); ++p)
    for (int32_t i : collider_.candidates(p)) {
      if (inverse_mass_[i] == 0) continue;
      const Contact contact = collider_.Touch(p, i, x_[i]);
      if (!contact.near || contact.distance >= settings_.thickness) continue;
      x_[i] += (settings_.thickness - contact.distance) * contact.normal;
      touching_[i] = 1, slide_[i] = contact.velocity, slide_normal_[i] = contact.normal;
    }
}

void Solver::UpdateVelocities() {
  const float per_second = 1 / dt_, keep = std::exp(-settings_.contact_drag * dt_);
  for (size_t i = 0; i < x_.size(); ++i) {
    Vec v = per_second * (x_[i] - before_[i]);
    if (touching_[i]) {
      const Vec relative = v - slide_[i];
      const Vec across = Dot(relative, slide_normal_[i]) * slide_normal_[i];
      v = slide_[i] + across + keep * (relative - across);
    }
    const float speed = Length(v);
    if (speed > kMaxSpeed) v = (kMaxSpeed / speed) * v;
    v_[i] = v;
  }
}

void Solver::SmoothVelocities() {
  const float share = 1 - std::exp(-settings_.smoothing * dt_ * kEvery);
  for (size_t i = 0; i < v_.size(); ++i) {
    smoothed_[i] = v_[i];
    const int32_t first = mesh_.first[i], last = mesh_.first[i + 1];
    if (inverse_mass_[i] == 0 || first == last) continue;
    Vec sum{};
    for (int32_t k = first; k < last; ++k) sum += v_[mesh_.neighbours[k]];
    smoothed_[i] += share * ((1 / static_cast<float>(last - first)) * sum - v_[i]);
  }
  v_.swap(smoothed_);
}

bool Solver::Write(float* out) const {
  for (const Vec& x : x_) {
    const Vec world = x + origin_;
    *out++ = world.x, *out++ = world.y, *out++ = world.z;
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
  if (p.frames < 1 || p.settings.steps < 1 || p.body_parts < 0 || p.body_parts > 32 || p.pinned < 1 ||
      !within(p.face, 3 * p.faces, p.vertices) || !within(p.pin, p.pinned, p.vertices) ||
      !within(p.body_face, 3 * p.body_faces, p.body_vertices))
    return 0;
  cloth_solver::Solver solver(p);
  const size_t size = 3 * static_cast<size_t>(p.vertices);
  solver.Write(out);
  for (int32_t frame = 1; frame < p.frames; ++frame) {
    solver.Frame(frame);
    if (!solver.Write(out + size * frame)) return frame;
  }
  return p.frames;
}
