#include "experiments/remeshing_ledger/organ_side.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

namespace spherecut::experiments::ledger {

namespace {

class SideGrid {
 public:
  SideGrid(std::shared_ptr<const topology::Domain> domain, double cell) : domain_(std::move(domain)), cell_(cell) {
    const BoundingBox box = domain_->bounds();
    lower_ = box.lower;
    upper_ = box.upper;
    int most = 1;
    for (int d = 0; d < 3; ++d) {
      counts_[static_cast<std::size_t>(d)] = 1 + static_cast<int>(box.extent()[d] / cell);
      most = std::max(most, counts_[static_cast<std::size_t>(d)]);
    }
    sides_.assign(static_cast<std::size_t>(counts_[0]) * counts_[1] * counts_[2], near);
    int block = 1;
    while (block < most)
      block *= 2;
    fill({0, 0, 0}, block);
  }

  [[nodiscard]] bool inside(const Vector3& x) const {
    if ((x.array() < lower_.array()).any() || (x.array() > upper_.array()).any())
      return false;
    std::array<int, 3> at;
    for (int d = 0; d < 3; ++d)
      at[static_cast<std::size_t>(d)] =
          std::min(static_cast<int>((x[d] - lower_[d]) / cell_), counts_[static_cast<std::size_t>(d)] - 1);
    const char side = sides_[index(at)];
    return side == near ? domain_->signed_distance(x) < 0 : side == within;
  }

 private:
  static constexpr char near = 0, within = 1, without = 2;

  [[nodiscard]] std::size_t index(const std::array<int, 3>& c) const {
    return (static_cast<std::size_t>(c[2]) * counts_[1] + c[1]) * counts_[0] + c[0];
  }

  /// A block whose middle lies farther from the surface than its corners do from there is all on one side.
  void fill(const std::array<int, 3>& from, int block) {
    if (from[0] >= counts_[0] || from[1] >= counts_[1] || from[2] >= counts_[2])
      return;
    Vector3 middle = lower_;
    for (int d = 0; d < 3; ++d)
      middle[d] += cell_ * (from[static_cast<std::size_t>(d)] + 0.5 * block);
    const double distance = domain_->signed_distance(middle), reach = 0.5 * std::sqrt(3.0) * cell_ * block;
    if (std::abs(distance) > 1.1 * reach) {
      for (int z = from[2]; z < std::min(from[2] + block, counts_[2]); ++z)
        for (int y = from[1]; y < std::min(from[1] + block, counts_[1]); ++y)
          for (int x = from[0]; x < std::min(from[0] + block, counts_[0]); ++x)
            sides_[index({x, y, z})] = distance < 0 ? within : without;
      return;
    }
    if (block == 1)
      return;
    const int half = block / 2;
    for (int k = 0; k < 8; ++k)
      fill({from[0] + (k & 1) * half, from[1] + ((k >> 1) & 1) * half, from[2] + ((k >> 2) & 1) * half}, half);
  }

  std::shared_ptr<const topology::Domain> domain_;
  double cell_;
  Vector3 lower_, upper_;
  std::array<int, 3> counts_{};
  std::vector<char> sides_;
};

} // namespace

std::function<bool(const Vector3& x)> side_of_organ(std::shared_ptr<const topology::Domain> domain, double cell) {
  const auto grid = std::make_shared<const SideGrid>(std::move(domain), cell);
  return [grid](const Vector3& x) { return grid->inside(x); };
}

} // namespace spherecut::experiments::ledger
