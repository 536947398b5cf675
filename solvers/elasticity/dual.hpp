// Dual numbers: a value and its derivatives by `n` variables, carried through arithmetic (automatic differentiation).
// And the functions that material laws need, for doubles too; law_lanes.inl has them for packs.
#pragma once

#include <array>
#include <cmath>

namespace spherecut::solvers {

[[nodiscard]] inline double logarithm(double a) {
  return std::log(a);
}
[[nodiscard]] inline double exponential(double a) {
  return std::exp(a);
}
[[nodiscard]] inline double root(double a) {
  return std::sqrt(a);
}
[[nodiscard]] inline double positive_part(double a) {
  return a > 0 ? a : 0;
}

template <int n>
struct Dual {
  double value = 0;
  std::array<double, n> slope{};

  Dual() = default;
  Dual(double constant) : value(constant) {} // NOLINT(google-explicit-constructor): a constant is a number like others
  /// The k-th variable.
  static Dual variable(double value, int k) {
    Dual x(value);
    x.slope[k] = 1;
    return x;
  }
  /// f(a), where f has that value and derivative.
  static Dual chain(double f, double derivative, const Dual& a) {
    Dual x(f);
    for (int k = 0; k < n; ++k)
      x.slope[k] = derivative * a.slope[k];
    return x;
  }
  Dual& operator+=(const Dual& b) {
    value += b.value;
    for (int k = 0; k < n; ++k)
      slope[k] += b.slope[k];
    return *this;
  }
  Dual& operator-=(const Dual& b) {
    value -= b.value;
    for (int k = 0; k < n; ++k)
      slope[k] -= b.slope[k];
    return *this;
  }
  Dual operator-() const { return chain(-value, -1, *this); }
  friend Dual operator+(Dual a, const Dual& b) { return a += b; }
  friend Dual operator-(Dual a, const Dual& b) { return a -= b; }
  friend Dual operator*(const Dual& a, const Dual& b) {
    Dual x(a.value * b.value);
    for (int k = 0; k < n; ++k)
      x.slope[k] = a.slope[k] * b.value + a.value * b.slope[k];
    return x;
  }
  friend Dual operator*(double a, const Dual& b) { return chain(a * b.value, a, b); }
  friend Dual operator*(const Dual& a, double b) { return b * a; }
  friend Dual operator/(const Dual& a, const Dual& b) { return a * chain(1 / b.value, -1 / (b.value * b.value), b); }
  friend Dual operator/(const Dual& a, double b) { return (1 / b) * a; }
  friend Dual logarithm(const Dual& a) { return chain(std::log(a.value), 1 / a.value, a); }
  friend Dual exponential(const Dual& a) {
    const double f = std::exp(a.value);
    return chain(f, f, a);
  }
  friend Dual positive_part(const Dual& a) { return a.value > 0 ? a : Dual(); }
};

} // namespace spherecut::solvers
