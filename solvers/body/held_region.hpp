// The part of a surface that is held, told point by point, for every axis.
#pragma once

#include "topology/base/types.hpp"

#include <array>
#include <cstddef>
#include <functional>
#include <type_traits>
#include <utility>

namespace spherecut::solvers {

/// Made from a function of (x, normal), which holds all axes where it is true, or from one of (x, normal, axis), axis 0
/// to 2. Empty: nothing is told.
class HeldRegion {
 public:
  HeldRegion() = default;
  HeldRegion(std::nullptr_t) {} // NOLINT(google-explicit-constructor): as of a function
  template <typename Holds>
  requires(!std::is_same_v<Holds, HeldRegion> &&
           (std::is_invocable_r_v<bool, const Holds&, const Vector3&, const Vector3&> ||
            std::is_invocable_r_v<bool, const Holds&, const Vector3&, const Vector3&, int>))
      HeldRegion(Holds holds) { // NOLINT(google-explicit-constructor): a lambda is given in its place
    if constexpr (std::is_invocable_r_v<bool, const Holds&, const Vector3&, const Vector3&, int>)
      along_ = std::move(holds);
    else
      fully_ = std::move(holds);
  }

  explicit operator bool() const { return fully_ || along_; }

  /// Whether it is told axis by axis.
  [[nodiscard]] bool by_axis() const { return static_cast<bool>(along_); }

  /// Whether the point is held along each of these axes.
  [[nodiscard]] bool holds(const Vector3& x, const Vector3& normal, const std::array<bool, 3>& axes) const {
    if (fully_)
      return fully_(x, normal);
    for (int axis = 0; axis < 3; ++axis)
      if (axes[axis] && !along_(x, normal, axis))
        return false;
    return static_cast<bool>(along_);
  }

  /// Whether the point is held along all axes, so that no force moves it.
  bool operator()(const Vector3& x, const Vector3& normal) const { return holds(x, normal, {true, true, true}); }

 private:
  std::function<bool(const Vector3& x, const Vector3& normal)> fully_;
  std::function<bool(const Vector3& x, const Vector3& normal, int axis)> along_;
};

} // namespace spherecut::solvers
