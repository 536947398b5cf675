// Body of a law kernel, written for registers of `width` doubles. The including unit defines, in its own unnamed
// namespace: width, Pack (a GCC vector of `width` doubles), root(Pack).

using Bits __attribute__((vector_size(sizeof(Pack)))) = unsigned long long;

inline Pack positive_part(Pack a) {
  return a > 0.0 ? a : Pack{};
}

// ln x of positive normal numbers: x = 2^e m with m between sqrt(1/2) and sqrt(2), ln m = 2 atanh((m - 1) / (m + 1)).
// Others give a number that means nothing.
inline Pack logarithm(Pack x) {
  constexpr unsigned long long half_root = 0x3fe6a09e667f3bcd, one = 1023, magic = 0x4330000000000000; // magic: 2^52
  const Bits bits = (Bits)x;
  const Bits biased = (bits - half_root + (one << 52)) >> 52;
  const Pack exponent = (Pack)(biased | magic) - (4503599627370496.0 + 1023.0);
  const Pack f = (Pack)(bits - ((biased - one) << 52)) - 1.0;
  const Pack s = f / (2.0 + f), z = s * s;
  Pack sum = Pack{} + 2.0 / 21;
  for (int odd = 19; odd >= 3; odd -= 2)
    sum = sum * z + 2.0 / odd;
  const Pack small = s * z * sum + exponent * 1.9082149292705877e-10;
  return exponent * 0.69314718036912382 + (2.0 * s + small);
}

// exp x = 2^k exp r with |r| <= ln(2) / 2; infinite above 709, zero below -708.
inline Pack exponential(Pack x) {
  constexpr double magic = 6755399441055744.0; // 1.5 2^52: the sum's last bits are the integer
  Pack bounded = x < 709.0 ? x : Pack{} + 709.0;
  bounded = bounded > -708.0 ? bounded : Pack{} - 708.0;
  const Pack shifted = bounded * 1.4426950408889634 + magic, k = shifted - magic;
  const Pack r = (bounded - k * 0.69314718036912382) - k * 1.9082149292705877e-10;
  Pack sum = Pack{} + 1.0 / 6227020800.0; // 1 / 13!
  double factor = 1.0 / 6227020800.0;
  for (int n = 13; n >= 1; --n) {
    factor *= n;
    sum = sum * r + factor;
  }
  const Bits scale = ((Bits)shifted << 52) + (1023ULL << 52);
  Pack out = sum * (Pack)scale;
  out = x > 709.0 ? Pack{} + __builtin_inf() : out;
  return x < -708.0 ? Pack{} : out;
}

#include "solvers/elasticity/models.inl"

template <class Model>
void evaluate_model(const Batch& batch) {
  const Model model(batch.constants);
  for (std::size_t first = 0; first < batch.count; first += width) {
    const int lanes = batch.count - first < width ? static_cast<int>(batch.count - first) : width;
    alignas(sizeof(Pack)) double columns[15][width]; // a register each: gradient, frame
    const double* f = batch.gradients + 9 * first;
    const double* a = batch.frames + batch.frame_stride * first;
    for (int lane = 0; lane < width; ++lane) {
      for (int k = 0; k < 9; ++k) // lanes beyond the last are at rest
        columns[k][lane] = lane < lanes ? f[9 * lane + k] : (k % 4 == 0 ? 1.0 : 0.0);
      for (int k = 0; k < 6; ++k)
        columns[9 + k][lane] = lane < lanes ? a[batch.frame_stride * lane + k] : 0.0;
    }
    Pack gradient[9], frame[6], stress[9];
    __builtin_memcpy(gradient, columns, sizeof gradient);
    __builtin_memcpy(frame, columns[9], sizeof frame);
    const Pack energy = model.template evaluate<Pack, Pack>(gradient, frame, batch.bulk, stress);
    Pack valid = Pack{} + 1.0;
    if constexpr (!Model::any_gradient)
      valid = Deformation<Pack>(gradient).jacobian;
    for (int lane = 0; lane < lanes; ++lane) {
      const bool good = valid[lane] > 0 && energy[lane] < __builtin_inf();
      batch.energy[first + lane] = good ? energy[lane] : __builtin_inf();
      double* p = batch.stress + 9 * (first + lane);
      for (int k = 0; k < 9; ++k)
        p[k] = good ? stress[k][lane] : 0.0;
    }
  }
}

template <class... Model>
constexpr Kernel kernel_of_models(const char* name, ModelList<Model...> /*models*/) {
  static_assert(sizeof...(Model) == sizeof(Kernel::evaluate) / sizeof(Evaluate), "a law without a kernel");
  return {name, width, {evaluate_model<Model>...}};
}
constexpr Kernel kernel_of(const char* name) {
  return kernel_of_models(name, Models{});
}
