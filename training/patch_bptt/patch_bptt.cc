// Order of a window: forward tick by tick; backward the other way. The gradient stops at the state before the window.
#include "training/patch_bptt/patch_bptt.h"

#include <Eigen/Core>
#include <vector>

#include "training/patch_bptt/inputs.h"

namespace patch_bptt {
namespace {

template <class Real>
using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
template <class Real>
using Rows = Eigen::Map<Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
template <class Real>
using ConstRows = Eigen::Map<const Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
template <class Real>
using Columns = Eigen::Map<Matrix<Real>>;
template <class Real>
using ConstColumns = Eigen::Map<const Matrix<Real>>;

constexpr double kMove = 0.1;  // of the outputs: metres

// Where each weight lies in the flat array.
struct Places {
  int64_t embed, enter, enter_bias, mix, of_input, of_state, gates, out, out_bias, skip, keep, size;
  int64_t a_layer;
  explicit Places(const patch_bptt_shape& s) {
    const int64_t W = s.width, I = 19 * s.points + 33 + s.embedding, O = 3 * s.points;
    embed = 0;
    enter = embed + static_cast<int64_t>(s.patches) * s.embedding;
    enter_bias = enter + W * I;
    mix = enter_bias + W;
    a_layer = W * (1 + s.neighbours) * W + W;
    of_input = mix + s.layers * a_layer;
    of_state = of_input + 3 * W * W;
    gates = of_state + 3 * W * W;
    out = gates + 3 * W;
    out_bias = out + O * W;
    skip = out_bias + O;
    keep = skip + O * I;
    size = keep + s.points;
  }
};

bool Possible(const patch_bptt_shape& s) {
  return s.streams > 0 && s.ticks > 0 && s.joints > 0 && s.patches > 0 && s.points > 0 && s.width > 0 &&
         s.embedding >= 0 && s.layers >= 0 && s.neighbours >= 0;
}

template <class Real>
class Window {
 public:
  Window(const patch_bptt_shape& s, const Real* geometry, const Real* weights, const Real* poses)
      : s_(s),
        at_(s),
        w_(weights),
        poses_(poses),
        inputs_(s, geometry),
        K_(s.patches),
        N_(s.streams * s.patches),
        R_(s.points),
        W_(s.width),
        I_(Inputs<Real>::Count(s)),
        O_(3 * s.points),
        G_((1 + s.neighbours) * s.width) {}

  static int64_t TickTape(const patch_bptt_shape& s) {
    const int64_t N = static_cast<int64_t>(s.streams) * s.patches;
    // x, f of each layer, gates r z q, the state's part of q, h before, the cloth two ticks ago
    return N * (Inputs<Real>::Count(s) + (1 + s.layers) * s.width + 4 * s.width + s.width + 3 * s.points);
  }

  void Forward(const Real* noise, Real* last, Real* before, Real* hidden, Real* tape, Real* moved) {
    std::vector<Real> own(tape == nullptr ? TickTape(s_) : 0);
    Columns<Real> h(hidden, W_, N_), u(last, O_, N_), earlier(before, O_, N_);
    Matrix<Real> a(3 * W_, N_), c(3 * W_, N_), gathered(G_, N_);
    const Matrix<Real> keep = Keep();
    for (int32_t t = 0; t < s_.ticks; ++t) {
      Tape p(tape == nullptr ? own.data() : tape + t * TickTape(s_), *this);
      if (noise != nullptr) u += ConstColumns<Real>(noise + t * int64_t{O_} * N_, O_, N_);
      Fill(t, last, before, p.x.data());
      p.h = h;
      p.f[0].noalias() = ConstRows<Real>(w_ + at_.enter, W_, I_) * p.x;
      p.f[0].colwise() += Bias(at_.enter_bias, W_);
      p.f[0] = p.f[0].cwiseMax(Real(0));
      for (int32_t l = 0; l < s_.layers; ++l) {
        Gather(l, p.f[l], &gathered);
        Columns<Real>& next = p.f[l + 1];
        next.noalias() = ConstRows<Real>(w_ + Mix(l), W_, G_) * gathered;
        next.colwise() += Bias(Mix(l) + int64_t{W_} * G_, W_);
        next = next.cwiseMax(Real(0)) + p.f[l];
      }
      a.noalias() = ConstRows<Real>(w_ + at_.of_input, 3 * W_, W_) * p.f[s_.layers];
      a.colwise() += Bias(at_.gates, 3 * W_);
      c.noalias() = ConstRows<Real>(w_ + at_.of_state, 3 * W_, W_) * h;
      // One by one: at the ends of a vectorised loop, which lie where memory begins, Eigen's exp has other bits.
      p.rz = (a.topRows(2 * W_) + c.topRows(2 * W_)).unaryExpr([](Real v) { return 1 / (1 + std::exp(-v)); });
      p.c = c.bottomRows(W_);
      p.q = (a.bottomRows(W_).array() + p.rz.topRows(W_).array() * p.c.array()).tanh();
      h = p.q.array() + p.rz.bottomRows(W_).array() * (h - p.q).array();
      Columns<Real> out(moved + t * int64_t{O_} * N_, O_, N_);
      out.noalias() = ConstRows<Real>(w_ + at_.out, O_, W_) * h;
      out.noalias() += ConstRows<Real>(w_ + at_.skip, O_, I_) * p.x;
      out.colwise() += Bias(at_.out_bias, O_);
      out = Real(kMove) * out.array() + u.array().colwise() * keep.col(0).array();
      p.u = u;
      earlier = u;
      u = out;
    }
  }

  void Backward(const Real* tape, const Real* by_moved, Real* gradient) {
    std::fill(gradient, gradient + at_.size, Real(0));
    Matrix<Real> by_u = Matrix<Real>::Zero(O_, N_), by_earlier = Matrix<Real>::Zero(O_, N_);
    Matrix<Real> by_h = Matrix<Real>::Zero(W_, N_), by_gates(3 * W_, N_), by_state(3 * W_, N_), gathered(G_, N_);
    Matrix<Real> by_f(W_, N_), by_x(I_, N_), by_out(O_, N_), by_gathered(G_, N_), open(W_, N_), h(W_, N_);
    const Matrix<Real> keep = Keep();
    for (int32_t t = s_.ticks - 1; t >= 0; --t) {
      const Tape p(const_cast<Real*>(tape) + t * TickTape(s_), *this);
      by_u += ConstColumns<Real>(by_moved + t * int64_t{O_} * N_, O_, N_);
      Matrix<Real> by_last = by_u.array().colwise() * keep.col(0).array();
      Rows<Real> by_keep(gradient + at_.keep, 1, R_);
      const Matrix<Real> each = (by_u.array() * p.u.array()).rowwise().sum();
      for (int32_t c = 0; c < 3; ++c) by_keep += each.block(c * R_, 0, R_, 1).transpose();
      by_out = Real(kMove) * by_u;
      h = p.q.array() + p.rz.bottomRows(W_).array() * (p.h - p.q).array();
      Rows<Real>(gradient + at_.out, O_, W_).noalias() += by_out * h.transpose();
      Rows<Real>(gradient + at_.skip, O_, I_).noalias() += by_out * p.x.transpose();
      AddBias(by_out, gradient + at_.out_bias);
      by_x.noalias() = ConstRows<Real>(w_ + at_.skip, O_, I_).transpose() * by_out;
      by_h.noalias() += ConstRows<Real>(w_ + at_.out, O_, W_).transpose() * by_out;
      // h' = q + z (h - q)
      const auto r = p.rz.topRows(W_).array(), z = p.rz.bottomRows(W_).array();
      by_gates.bottomRows(W_) = by_h.array() * (1 - z) * (1 - p.q.array().square());
      by_gates.middleRows(W_, W_) = by_h.array() * (p.h - p.q).array() * z * (1 - z);
      by_gates.topRows(W_) = by_gates.bottomRows(W_).array() * p.c.array() * r * (1 - r);
      by_state.topRows(2 * W_) = by_gates.topRows(2 * W_);
      by_state.bottomRows(W_) = by_gates.bottomRows(W_).array() * r;
      by_h = by_h.array() * z;
      by_h.noalias() += ConstRows<Real>(w_ + at_.of_state, 3 * W_, W_).transpose() * by_state;
      Rows<Real>(gradient + at_.of_state, 3 * W_, W_).noalias() += by_state * p.h.transpose();
      Rows<Real>(gradient + at_.of_input, 3 * W_, W_).noalias() += by_gates * p.f[s_.layers].transpose();
      AddBias(by_gates, gradient + at_.gates);
      by_f.noalias() = ConstRows<Real>(w_ + at_.of_input, 3 * W_, W_).transpose() * by_gates;
      for (int32_t l = s_.layers - 1; l >= 0; --l) {
        open = (p.f[l + 1].array() > p.f[l].array()).select(by_f, Real(0));
        Gather(l, p.f[l], &gathered);
        Rows<Real>(gradient + Mix(l), W_, G_).noalias() += open * gathered.transpose();
        AddBias(open, gradient + Mix(l) + int64_t{W_} * G_);
        by_gathered.noalias() = ConstRows<Real>(w_ + Mix(l), W_, G_).transpose() * open;
        Scatter(l, by_gathered, &by_f);
      }
      open = (p.f[0].array() > 0).select(by_f, Real(0));
      Rows<Real>(gradient + at_.enter, W_, I_).noalias() += open * p.x.transpose();
      AddBias(open, gradient + at_.enter_bias);
      by_x.noalias() += ConstRows<Real>(w_ + at_.enter, W_, I_).transpose() * open;
      for (int64_t n = 0; n < N_ && s_.embedding > 0; ++n) {
        Real* e = gradient + at_.embed + (n % K_) * s_.embedding;
        for (int32_t i = 0; i < s_.embedding; ++i) e[i] += by_x(I_ - s_.embedding + i, n);
      }
      Matrix<Real> by_before = Matrix<Real>::Zero(O_, N_);
      PatchFrame<Real> frames[kFrames];
      Pose<Real> poses[kFrames];
      for (int32_t b = 0; b < s_.streams; ++b) {
        for (int32_t k = 0; k < K_; ++k) {
          const int64_t n = int64_t{b} * K_ + k;
          Frames(b, t, k, poses, frames);
          inputs_.Back(frames, p.x.data() + n * I_, by_x.data() + n * I_, by_last.data() + n * O_,
                       by_before.data() + n * O_);
        }
      }
      by_u = by_last + by_earlier;
      by_earlier = by_before;
    }
    Rows<Real> by_keep(gradient + at_.keep, 1, R_);
    by_keep =
        by_keep.array() * keep.col(0).head(R_).transpose().array() * (1 - keep.col(0).head(R_).transpose().array());
  }

 private:
  // Views into one tick's tape.
  struct Tape {
    Columns<Real> x, rz, q, c, h, u;
    std::vector<Columns<Real>> f;
    Tape(Real* p, const Window& w)
        : x(p, w.I_, w.N_),
          rz(p += w.I_ * w.N_, 2 * w.W_, w.N_),
          q(p += 2 * w.W_ * w.N_, w.W_, w.N_),
          c(p += w.W_ * w.N_, w.W_, w.N_),
          h(p += w.W_ * w.N_, w.W_, w.N_),
          u(p += w.W_ * w.N_, w.O_, w.N_) {
      p += w.O_ * w.N_;
      for (int32_t l = 0; l <= w.s_.layers; ++l, p += w.W_ * w.N_) f.emplace_back(p, w.W_, w.N_);
    }
  };

  int64_t Mix(int32_t l) const { return at_.mix + l * at_.a_layer; }
  ConstColumns<Real> Bias1(int64_t at, int64_t rows) const { return {w_ + at, rows, 1}; }
  Eigen::Map<const Eigen::Matrix<Real, Eigen::Dynamic, 1>> Bias(int64_t at, int64_t rows) const {
    return {w_ + at, rows};
  }
  static void AddBias(const Matrix<Real>& by, Real* gradient) {
    Eigen::Map<Eigen::Matrix<Real, Eigen::Dynamic, 1>>(gradient, by.rows()) += by.rowwise().sum();
  }
  Matrix<Real> Keep() const {
    Matrix<Real> keep(O_, 1);
    for (int64_t i = 0; i < O_; ++i) keep(i, 0) = 1 / (1 + std::exp(-w_[at_.keep + i % R_]));
    return keep;
  }

  template <class F>
  void Gather(int32_t l, const F& f, Matrix<Real>* to) const {
    for (int64_t n = 0; n < N_; ++n) {
      const int64_t first = n - n % K_;
      to->col(n).head(W_) = f.col(n);
      for (int32_t s = 0; s < s_.neighbours; ++s)
        to->col(n).segment((1 + s) * W_, W_) = f.col(first + s_.near[(l * s_.neighbours + s) * K_ + n % K_]);
    }
  }

  // by_f gains what the gathered columns are worth; itself already holds the residual's part.
  void Scatter(int32_t l, const Matrix<Real>& from, Matrix<Real>* by_f) const {
    for (int64_t n = 0; n < N_; ++n) {
      const int64_t first = n - n % K_;
      by_f->col(n) += from.col(n).head(W_);
      for (int32_t s = 0; s < s_.neighbours; ++s)
        by_f->col(first + s_.near[(l * s_.neighbours + s) * K_ + n % K_]) += from.col(n).segment((1 + s) * W_, W_);
    }
  }

  void Frames(int32_t b, int32_t t, int32_t k, Pose<Real>* poses, PatchFrame<Real>* frames) const {
    const int64_t size = 12 * s_.joints + 6;
    V3<Real> from = {};
    for (int i = 0; i < kFrames; ++i) {
      poses[i] = {poses_ + (int64_t{b} * (s_.ticks + 2) + t + 2 - i) * size, s_.joints};
      inputs_.Frame(poses[i], from, k, &frames[i]);
      from = from - poses[i].HipsWay();
    }
  }

  void Fill(int32_t t, const Real* last, const Real* before, Real* x) const {
    Pose<Real> poses[kFrames];
    PatchFrame<Real> frames[kFrames];
    for (int32_t b = 0; b < s_.streams; ++b) {
      for (int32_t k = 0; k < K_; ++k) {
        const int64_t n = int64_t{b} * K_ + k;
        Frames(b, t, k, poses, frames);
        inputs_.Read(poses, frames, k, last + n * O_, before + n * O_, x + n * I_);
        const Real* embed = w_ + at_.embed + int64_t{k} * s_.embedding;
        std::copy(embed, embed + s_.embedding, x + (n + 1) * I_ - s_.embedding);
      }
    }
  }

  const patch_bptt_shape& s_;
  const Places at_;
  const Real *w_, *poses_;
  const Inputs<Real> inputs_;
  const int64_t K_, N_, R_, W_, I_, O_, G_;
};

template <class Real>
int32_t Forward(const patch_bptt_shape* s, const Real* geometry, const Real* weights, const Real* poses,
                const Real* noise, Real* last, Real* before, Real* hidden, Real* tape, Real* moved) {
  if (!Possible(*s)) return 0;
  Window<Real>(*s, geometry, weights, poses).Forward(noise, last, before, hidden, tape, moved);
  return 1;
}

template <class Real>
int32_t Backward(const patch_bptt_shape* s, const Real* geometry, const Real* weights, const Real* poses,
                 const Real* tape, const Real* by_moved, Real* gradient) {
  if (!Possible(*s)) return 0;
  Window<Real>(*s, geometry, weights, poses).Backward(tape, by_moved, gradient);
  return 1;
}

}  // namespace
}  // namespace patch_bptt

#define EXPORTED extern "C" __attribute__((visibility("default")))

EXPORTED int64_t patch_bptt_weights_size(const patch_bptt_shape* s) {
  return patch_bptt::Possible(*s) ? patch_bptt::Places(*s).size : 0;
}
EXPORTED int64_t patch_bptt_tape_size(const patch_bptt_shape* s) {
  return patch_bptt::Possible(*s) ? s->ticks * patch_bptt::Window<float>::TickTape(*s) : 0;
}
EXPORTED int32_t patch_bptt_forward_f32(const patch_bptt_shape* s, const float* g, const float* w, const float* p,
                                        const float* noise, float* last, float* before, float* hidden, float* tape,
                                        float* moved) {
  return patch_bptt::Forward(s, g, w, p, noise, last, before, hidden, tape, moved);
}
EXPORTED int32_t patch_bptt_forward_f64(const patch_bptt_shape* s, const double* g, const double* w, const double* p,
                                        const double* noise, double* last, double* before, double* hidden, double* tape,
                                        double* moved) {
  return patch_bptt::Forward(s, g, w, p, noise, last, before, hidden, tape, moved);
}
EXPORTED int32_t patch_bptt_backward_f32(const patch_bptt_shape* s, const float* g, const float* w, const float* p,
                                         const float* tape, const float* by, float* gradient) {
  return patch_bptt::Backward(s, g, w, p, tape, by, gradient);
}
EXPORTED int32_t patch_bptt_backward_f64(const patch_bptt_shape* s, const double* g, const double* w, const double* p,
                                         const double* tape, const double* by, double* gradient) {
  return patch_bptt::Backward(s, g, w, p, tape, by, gradient);
}
