#include "solvers/stiffness_kernel.hpp"

#include "topology/types.hpp"

#include <catch2/catch.hpp>
#include <memory>
#include <random>

using namespace spherecut;

TEST_CASE("The stiffness kernel gives the sum over points of the elastic blocks") {
  const double lambda = 1.7, mu = 0.6;
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> value(-1, 1);
  const auto out = std::make_unique<solvers::StiffnessColumn>();
  for (int count : {1, 2, 7, 8, 9, 15, 16, 17, 31, 33, 40, 65, 511, 512})
    for (int points : {1, 8, 27, 64}) {
      const int stride = (count + 7) / 8 * 8;
      std::vector<double> gradients(static_cast<std::size_t>(3 * points) * stride, 0.0);
      for (int plane = 0; plane < 3 * points; ++plane)
        for (int k = 0; k < count; ++k)
          gradients[static_cast<std::size_t>(plane) * stride + k] = value(random);
      const auto gradient = [&](int q, int k) {
        const double* base = gradients.data() + static_cast<std::size_t>(3 * q) * stride;
        return Vector3(base[k], base[stride + k], base[2 * stride + k]);
      };
      std::vector<double> signs(points);
      for (int q = 0; q < points; ++q)
        signs[q] = q % 3 == 1 ? -1 : 1;
      for (int first : {0, count / 3, count - 1}) {
        const int column = first;
        const bool is_signed = first > 0;
        solvers::stiffness_column(gradients.data(), is_signed ? signs.data() : nullptr, points, stride, first, count,
                                  column, lambda, mu, *out);
        double worst = 0;
        for (int row = first; row < count; ++row) {
          Matrix3 block = Matrix3::Zero();
          for (int q = 0; q < points; ++q) {
            const Vector3 g = gradient(q, row), f = gradient(q, column);
            block += (is_signed ? signs[q] : 1) *
                     (lambda * g * f.transpose() + mu * f * g.transpose() + mu * g.dot(f) * Matrix3::Identity());
          }
          for (int a = 0; a < 3; ++a)
            for (int b = 0; b < 3; ++b)
              worst = std::max(worst, std::abs(out->plane[3 * a + b][row] - block(a, b)));
        }
        CHECK(worst < 1e-12);
      }
    }
}
