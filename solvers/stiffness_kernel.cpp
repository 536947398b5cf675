#include "solvers/stiffness_kernel.hpp"

namespace spherecut::solvers {

// One function, compiled for the baseline and for the vector widths of the machine; the loader picks once.
__attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4"))) void
stiffness_column(const double* gradients, int points, int stride, int first, int count, int column, double lambda,
                 double mu, StiffnessColumn& out) {
  const int begin = first & ~7;
  const double both = lambda + mu;
  for (int block = begin; block < count; block += 8) {
    double m[9][8] = {};
    for (int q = 0; q < points; ++q) {
      const double* x = gradients + static_cast<long>(3 * q) * stride;
      const double* y = x + stride;
      const double* z = y + stride;
      const double jx = x[column], jy = y[column], jz = z[column];
      for (int l = 0; l < 8; ++l) {
        const double a = x[block + l], b = y[block + l], c = z[block + l];
        m[0][l] += a * jx;
        m[1][l] += a * jy;
        m[2][l] += a * jz;
        m[3][l] += b * jx;
        m[4][l] += b * jy;
        m[5][l] += b * jz;
        m[6][l] += c * jx;
        m[7][l] += c * jy;
        m[8][l] += c * jz;
      }
    }
    for (int l = 0; l < 8; ++l) {
      const double trace = mu * (m[0][l] + m[4][l] + m[8][l]);
      out.plane[0][block + l] = both * m[0][l] + trace;
      out.plane[1][block + l] = lambda * m[1][l] + mu * m[3][l];
      out.plane[2][block + l] = lambda * m[2][l] + mu * m[6][l];
      out.plane[3][block + l] = lambda * m[3][l] + mu * m[1][l];
      out.plane[4][block + l] = both * m[4][l] + trace;
      out.plane[5][block + l] = lambda * m[5][l] + mu * m[7][l];
      out.plane[6][block + l] = lambda * m[6][l] + mu * m[2][l];
      out.plane[7][block + l] = lambda * m[7][l] + mu * m[5][l];
      out.plane[8][block + l] = both * m[8][l] + trace;
    }
  }
}

} // namespace spherecut::solvers
