#include "solvers/elasticity/prony.hpp"

#include <Eigen/LU>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::solvers {
namespace {

constexpr int prony_row[6] = {0, 1, 2, 0, 0, 1}, prony_column[6] = {0, 1, 2, 1, 2, 2};

} // namespace

PronyState::PronyState(std::vector<PronyTerm> terms, std::size_t points, bool small_strain)
    : terms_(std::move(terms)), points_(points), small_strain_(small_strain), elastic_(points),
      fading_(points * terms_.size()), decay_(terms_.size(), 1), ramp_(terms_.size()), history_(points) {
  check_prony_terms(terms_);
  begin(0);
}

double PronyState::lasting_share() const {
  double share = 1;
  for (const PronyTerm& term : terms_)
    share -= term.share;
  return share;
}

void PronyState::check(std::size_t entries, const char* what) const {
  if (entries != points_)
    throw InputError(fmt::format("Prony series: {} {} for {} points; every point needs one", entries, what, points_));
}

void PronyState::begin(double duration) {
  if (!(duration >= 0) || !std::isfinite(duration))
    throw InputError(fmt::format("Prony series: the step lasts {} s; it must not be negative", duration));
  factor_ = 1;
  for (std::size_t p = 0; p < terms_.size(); ++p) {
    const double x = duration / terms_[p].time;
    decay_[p] = std::exp(-x);
    const double mean = x > 0 ? -std::expm1(-x) / x : 1;
    ramp_[p] = terms_[p].share * mean;
    factor_ -= terms_[p].share * (1 - mean);
  }
  for (std::size_t point = 0; point < points_; ++point)
    for (int k = 0; k < 6; ++k) {
      double sum = 0;
      for (std::size_t p = 0; p < terms_.size(); ++p)
        sum += decay_[p] * fading_[point * terms_.size() + p][k] - ramp_[p] * elastic_[point][k];
      history_[point][k] = sum;
    }
}

Matrix3 PronyState::history(std::size_t point) const {
  Matrix3 h;
  for (int k = 0; k < 6; ++k)
    h(prony_row[k], prony_column[k]) = h(prony_column[k], prony_row[k]) = history_.at(point)[k];
  return h;
}

void PronyState::apply(std::span<const Matrix3> gradients, std::span<double> energy, std::span<Matrix3> stress) const {
  check(gradients.size(), "gradients");
  check(energy.size(), "energies");
  check(stress.size(), "stresses");
  apply(0, gradients, energy, stress);
}

void PronyState::apply(std::size_t first, std::span<const Matrix3> gradients, std::span<double> energy,
                       std::span<Matrix3> stress) const {
  if (gradients.size() != energy.size() || gradients.size() != stress.size() || first + gradients.size() > points_)
    throw InputError(fmt::format("Prony series: {} gradients, {} energies and {} stresses from point {} of {} on",
                                 gradients.size(), energy.size(), stress.size(), first, points_));
  for (std::size_t point = 0; point < gradients.size(); ++point) {
    if (!std::isfinite(energy[point]))
      continue;
    const Matrix3 h = history(first + point);
    const Matrix3& f = gradients[point];
    if (small_strain_) {
      energy[point] = factor_ * energy[point] + h.cwiseProduct(f - Matrix3::Identity()).sum();
      stress[point] = factor_ * stress[point] + h;
    } else {
      const Matrix3 fh = f * h;
      energy[point] = factor_ * energy[point] + 0.5 * (fh.cwiseProduct(f).sum() - h.trace());
      stress[point] = factor_ * stress[point] + fh;
    }
  }
}

void PronyState::apply(std::size_t point, Matrix9& tangent) const {
  tangent *= factor_;
  if (small_strain_)
    return;
  const Matrix3 h = history(point);
  for (int l = 0; l < 3; ++l) // d(F H)_ij / dF_kl = delta_ik H_lj
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i)
        tangent(i + 3 * j, i + 3 * l) += h(l, j);
}

PronyState::Symmetric PronyState::elastic(const Matrix3& gradient, const Matrix3& stress) const {
  const Matrix3 s = small_strain_ ? stress : Matrix3(gradient.inverse() * stress);
  Symmetric out;
  for (int k = 0; k < 6; ++k)
    out[k] = 0.5 * (s(prony_row[k], prony_column[k]) + s(prony_column[k], prony_row[k]));
  return out;
}

void PronyState::accept(std::span<const Matrix3> gradients, std::span<const Matrix3> isochoric_stress) {
  check(gradients.size(), "gradients");
  check(isochoric_stress.size(), "stresses");
  for (std::size_t point = 0; point < points_; ++point) {
    const Symmetric now = elastic(gradients[point], isochoric_stress[point]);
    for (std::size_t p = 0; p < terms_.size(); ++p)
      for (int k = 0; k < 6; ++k) {
        double& fading = fading_[point * terms_.size() + p][k];
        fading = decay_[p] * fading + ramp_[p] * (now[k] - elastic_[point][k]);
      }
    elastic_[point] = now;
  }
  begin(0);
}

void PronyState::settle(std::span<const Matrix3> gradients, std::span<const Matrix3> isochoric_stress) {
  check(gradients.size(), "gradients");
  check(isochoric_stress.size(), "stresses");
  for (std::size_t point = 0; point < points_; ++point)
    elastic_[point] = elastic(gradients[point], isochoric_stress[point]);
  std::fill(fading_.begin(), fading_.end(), Symmetric{});
  begin(0);
}

} // namespace spherecut::solvers
