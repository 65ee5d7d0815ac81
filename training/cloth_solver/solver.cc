#include "solver.h"

#include <algorithm>
#include <cmath>

namespace cloth_solver {
namespace {

constexpr int kEvery = 4;            // steps between updates of normals and smoothed velocities
constexpr int kLayersEvery = 3;      // steps from one look at whether to search for layers that meet to the next
constexpr float kOpposed = -0.3f;    // cosine between two ways out, below which they oppose each other
constexpr float kBodyReach = 0.02f;  // m beyond what body and cloth travel in a frame

std::vector<Vec> Vecs(const float* from, int32_t count) {
  std::vector<Vec> out(count);
  for (int32_t i = 0; i < count; ++i) out[i] = {from[3 * i], from[3 * i + 1], from[3 * i + 2]};
  return out;
}

}  // namespace

Solver::Solver(const cloth_solver_problem& p)
    : problem_(p), settings_(p.settings), dt_(p.settings.frame_seconds / static_cast<float>(p.settings.steps)),
      mesh_(MakeMesh(p.vertices, p.faces, p.face, p.pattern, p.bend_scale, p.crease,
                     {p.settings.stretch, p.settings.bias, p.settings.bend})),
      body_(p.body_vertices, p.body_faces, p.body_face, p.body_part, p.body_parts,
            p.cloth_part ? std::vector<uint32_t>(p.cloth_part, p.cloth_part + p.vertices) : std::vector<uint32_t>(),
            p.vertices),
      layers_(mesh_, p.vertices), pins_(p.pin, p.pin + p.pinned), inverse_mass_(p.vertices), drag_normal_(p.vertices),
      drag_tangent_(p.vertices), x_(Vecs(p.start, p.vertices)), before_(x_), v_(p.vertices), smoothed_(p.vertices),
      pushed_(p.vertices) {
  for (int32_t i = 0; i < p.vertices; ++i) {
    const float density = settings_.density * (p.mass_scale ? p.mass_scale[i] : 1.0f), mass = density * mesh_.area[i];
    inverse_mass_[i] = mass > 0 ? 1 / mass : 0;
    const float pressure = 0.5f * settings_.air_density / std::max(density, 1e-6f);
    drag_normal_[i] = settings_.drag_normal * pressure, drag_tangent_[i] = settings_.drag_tangent * pressure;
  }
  for (int32_t pin : pins_) inverse_mass_[pin] = 0;
  tethers_ = Tethers(mesh_, p.vertices, pins_);
  points_.assign(p.vertices + 1, {});  // the last one fills blocks up
  MakeSprings();
  origin_ = {p.origin[0], p.origin[1], p.origin[2]};
  for (Vec& x : x_) x -= origin_;
  before_ = x_;
}

void Solver::MakeSprings() {
  const int32_t spare = problem_.vertices;
  std::vector<size_t> block_of(problem_.vertices, 0);  // last block that uses a vertex, from 1
  int used = kBlock;
  for (const Edge& e : mesh_.edges) {
    if (inverse_mass_[e.a] + inverse_mass_[e.b] == 0) continue;
    if (used == kBlock || block_of[e.a] == springs_.size() || block_of[e.b] == springs_.size()) {
      springs_.emplace_back(), used = 0;
      for (int k = 0; k < kBlock; ++k)
        springs_.back().a[k] = springs_.back().b[k] = spare, springs_.back().yield[k] = 1;
    }
    Springs& s = springs_.back();
    s.a[used] = e.a, s.b[used] = e.b, s.rest[used] = e.rest, s.yield[used] = 1 / (e.stiffness * dt_ * dt_);
    block_of[e.a] = block_of[e.b] = springs_.size();
    ++used;
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
  for (Vec& x : x_) x -= shift;
  if (p.wind) {
    const float* wind = p.wind + 3 * static_cast<size_t>(frame - 1);
    wind_from_ = {wind[0], wind[1], wind[2]}, wind_to_ = {wind[3], wind[4], wind[5]};
  }
  std::vector<Vec> from(p.body_vertices), to(p.body_vertices);
  for (int32_t b = 0; b < p.body_vertices; ++b) {
    from[b] = At(p.body_path, p.body_vertices, frame - 1, b);
    to[b] = At(p.body_path, p.body_vertices, frame, b);
  }
  float fastest = 0;
  for (const Vec& v : v_) fastest = std::max(fastest, Length(v));
  body_.BeginFrame(std::move(from), std::move(to), settings_.frame_seconds, x_,
                   std::min(fastest, settings_.max_speed) * settings_.frame_seconds, kBodyReach);
  pin_from_.resize(p.pinned), pin_to_.resize(p.pinned);
  for (int32_t k = 0; k < p.pinned; ++k) {
    pin_from_[k] = At(p.pin_path, p.pinned, frame - 1, k);
    pin_to_[k] = At(p.pin_path, p.pinned, frame, k);
  }
  for (int s = 0; s < settings_.steps; ++s) Step(static_cast<float>(s + 1) / static_cast<float>(settings_.steps));
}

void Solver::Step(float t) {
  wind_ = Mix(wind_from_, wind_to_, t);
  if (step_ % kEvery == 0) {
    Normals(mesh_, x_, normals_);
    Damp();
  }
  if (settings_.layer_thickness > 0 && step_ % kLayersEvery == 0 && layers_.Due(x_)) layers_.Find(x_);
  ++step_;
  body_.MoveTo(t);
  Predict();
  for (size_t k = 0; k < pins_.size(); ++k) x_[pins_[k]] = Mix(pin_from_[k], pin_to_[k], t);
  Bend();
  Stretch();
  HoldTethers();
  UpdateVelocities();
  if (settings_.layer_thickness > 0) layers_.Hold(&x_, &v_, inverse_mass_, settings_.layer_thickness);
  PushOut();
}

// Gravity, and air at rest or in wind: force along the normal and along the cloth, each with the square of its speed,
// implicit so that it never turns the relative velocity round.
void Solver::Predict() {
  for (size_t i = 0; i < x_.size(); ++i) {
    before_[i] = x_[i];
    if (inverse_mass_[i] == 0) continue;
    Vec& v = v_[i];
    const Vec& n = normals_[i];
    const Vec relative = v - wind_;
    const float across = Dot(relative, n);
    const Vec along = relative - across * n;
    const float a = drag_normal_[i] * std::abs(across) * dt_, b = drag_tangent_[i] * Length(along) * dt_;
    v -= (b / (1 + b)) * along + (a / (1 + a) * across) * n;
    v.y -= settings_.gravity * dt_;
    x_[i] += dt_ * v;
  }
}

void Solver::Bend() {
  const float per_squared = 1 / (dt_ * dt_);
  for (const Hinge& h : mesh_.hinges) {
    const auto& [a, b, c, d] = h.v;
    const float wa = inverse_mass_[a], wb = inverse_mass_[b], wc = inverse_mass_[c], wd = inverse_mass_[d];
    Vec bent = h.k[0] * x_[a] + h.k[1] * x_[b] + h.k[2] * x_[c] + h.k[3] * x_[d];
    if (h.rest != 0) bent -= h.rest * Unit(normals_[a] + normals_[b]);
    const float total = h.k[0] * h.k[0] * wa + h.k[1] * h.k[1] * wb + h.k[2] * h.k[2] * wc + h.k[3] * h.k[3] * wd;
    const float push = -1 / (total + h.compliance * per_squared);
    x_[a] += (push * wa * h.k[0]) * bent;
    x_[b] += (push * wb * h.k[1]) * bent;
    x_[c] += (push * wc * h.k[2]) * bent;
    x_[d] += (push * wd * h.k[3]) * bent;
  }
}

// All passes over the edges, kBlock at a time: those of a block share no vertex, so their roots and quotients are taken
// side by side. Position and inverse mass lie together, so that an end of an edge is one load.
void Solver::Stretch() {
  const float shortening = 1 / std::max(settings_.compression, 1e-6f);
  for (size_t i = 0; i < x_.size(); ++i) points_[i] = {x_[i], inverse_mass_[i]};
  for (int pass = 0; pass < settings_.stretch_passes; ++pass) {
    for (const Springs& s : springs_) {
      float dx[kBlock], dy[kBlock], dz[kBlock], w[kBlock], push[kBlock];
      for (int k = 0; k < kBlock; ++k) {
        const Point &a = points_[s.a[k]], &b = points_[s.b[k]];
        dx[k] = b.x.x - a.x.x, dy[k] = b.x.y - a.x.y, dz[k] = b.x.z - a.x.z, w[k] = a.w + b.w;
      }
      for (int k = 0; k < kBlock; ++k) {
        const float length = std::sqrt(dx[k] * dx[k] + dy[k] * dy[k] + dz[k] * dz[k]), longer = length - s.rest[k];
        const float yield = (longer < 0 ? shortening : 1.0f) * s.yield[k];
        push[k] = longer / ((w[k] + yield) * std::max(length, 1e-9f));
      }
      for (int k = 0; k < kBlock; ++k) {
        Point &a = points_[s.a[k]], &b = points_[s.b[k]];
        const float to_a = a.w * push[k], to_b = b.w * push[k];
        a.x.x += to_a * dx[k], a.x.y += to_a * dy[k], a.x.z += to_a * dz[k];
        b.x.x -= to_b * dx[k], b.x.y -= to_b * dy[k], b.x.z -= to_b * dz[k];
      }
    }
  }
  for (size_t i = 0; i < x_.size(); ++i) x_[i] = points_[i].x;
}

void Solver::HoldTethers() {
  for (size_t i = 0; i < x_.size(); ++i) {
    if (inverse_mass_[i] == 0 || tethers_[i].pin < 0) continue;
    const Vec& pin = x_[tethers_[i].pin];
    const Vec d = x_[i] - pin;
    const float most = settings_.tether * tethers_[i].length, squared = Dot(d, d);
    if (squared > most * most) x_[i] = pin + (most / std::sqrt(squared)) * d;
  }
}

void Solver::UpdateVelocities() {
  const float per_second = 1 / dt_;
  for (size_t i = 0; i < x_.size(); ++i) {
    Vec v = per_second * (x_[i] - before_[i]);
    const float speed = Length(v);
    if (speed > settings_.max_speed && inverse_mass_[i] > 0) {
      v = (settings_.max_speed / speed) * v;
      x_[i] = before_[i] + dt_ * v;
    }
    v_[i] = v;
  }
}

// Contacts move a vertex out of the body, take its approach velocity away and, by Coulomb's law, as much of its sliding
// as friction allows. The way out is no velocity of the cloth: where thigh and trunk both push, it would be flung away.
void Solver::PushOut() {
  for (int32_t p = 0; p < body_.parts(); ++p) {
    const std::vector<int32_t>& candidates = body_.candidates(p);
    for (int32_t k = 0; k < static_cast<int32_t>(candidates.size()); ++k) {
      const int32_t i = candidates[k];
      if (inverse_mass_[i] == 0) continue;
      const Contact contact = body_.Touch(p, k, x_[i], settings_.thickness);
      if (!contact.near) continue;
      // Between two surfaces closer than twice the thickness cloth ends in the middle.
      Push& last = pushed_[i];
      const bool between = last.step == step_ && Dot(last.normal, contact.normal) < kOpposed;
      last = {step_, contact.normal};
      x_[i] += ((between ? 0.5f : 1.0f) * (settings_.thickness - contact.distance)) * contact.normal;
      const Vec relative = v_[i] - contact.velocity;
      const float across = Dot(relative, contact.normal);
      if (across >= 0) continue;
      const Vec sliding = relative - across * contact.normal;
      const float speed = Length(sliding), least = -settings_.friction * across;
      v_[i] = contact.velocity + (speed > least ? 1 - least / speed : 0.0f) * sliding;
    }
  }
}

void Solver::Damp() {
  const float share = 1 - std::exp(-settings_.damping * dt_ * kEvery);
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
  if (p.frames < 1 || p.vertices < 1 || p.faces < 1 || p.settings.steps < 1 || p.body_parts < 0 || p.body_parts > 32 ||
      !within(p.face, 3 * p.faces, p.vertices) || !within(p.pin, p.pinned, p.vertices) ||
      !within(p.body_face, 3 * p.body_faces, p.body_vertices) || !within(p.body_part, p.body_faces, p.body_parts))
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
