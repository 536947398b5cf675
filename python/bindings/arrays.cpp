#include "python/bindings/arrays.hpp"

#include "topology/base/errors.hpp"

#include <cmath>
#include <cstring>
#include <fmt/format.h>

namespace spherecut::bindings {
namespace {

std::string shape_text(const py::array& array) {
  return std::string(py::str(array.attr("shape")));
}

[[noreturn]] void refuse_shape(const py::array& array, const char* name, const char* wanted) {
  throw InputError(fmt::format("{}: an array of shape {}; allowed: {}", name, shape_text(array), wanted));
}

void require_numbers(const Doubles& array, const char* name) {
  for (py::ssize_t i = 0; i < array.size(); ++i)
    if (!std::isfinite(array.data()[i]))
      throw InputError(
          fmt::format("{}: number {} in C order is {}; allowed: finite numbers", name, i, array.data()[i]));
}

template <class T>
std::vector<T> rows_from(const Doubles& array, std::size_t count) {
  static_assert(sizeof(T) % sizeof(double) == 0);
  std::vector<T> rows(count);
  if (count > 0)
    std::memcpy(static_cast<void*>(rows.data()), array.data(), count * sizeof(T));
  return rows;
}

} // namespace

std::vector<Vector3> points_from(const Doubles& array, const char* name) {
  if (array.ndim() != 2 || array.shape(1) != 3)
    refuse_shape(array, name, "(n, 3)");
  require_numbers(array, name);
  return rows_from<Vector3>(array, static_cast<std::size_t>(array.shape(0)));
}

std::vector<Vector3> one_or_more_points(const Doubles& array, const char* name) {
  if (array.ndim() == 1 && array.shape(0) == 3)
    return {vector_from(array, name)};
  if (array.ndim() != 2 || array.shape(1) != 3)
    refuse_shape(array, name, "(n, 3), or (3,) for one point");
  return points_from(array, name);
}

Vector3 vector_from(const Doubles& array, const char* name) {
  if (array.ndim() != 1 || array.shape(0) != 3)
    refuse_shape(array, name, "(3,)");
  require_numbers(array, name);
  return Eigen::Map<const Vector3>(array.data());
}

Matrix3 matrix_from(const Doubles& array, const char* name) {
  if (array.ndim() != 2 || array.shape(0) != 3 || array.shape(1) != 3)
    refuse_shape(array, name, "(3, 3)");
  require_numbers(array, name);
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(array.data());
}

std::vector<std::array<Vector3, 2>> segments_from(const Doubles& array, const char* name) {
  if (array.ndim() != 3 || array.shape(1) != 2 || array.shape(2) != 3)
    refuse_shape(array, name, "(n, 2, 3)");
  require_numbers(array, name);
  return rows_from<std::array<Vector3, 2>>(array, static_cast<std::size_t>(array.shape(0)));
}

Integers integers_from(const py::array& array, const char* name, long from, long to) {
  const char kind = array.dtype().kind();
  if (array.size() > 0 && kind != 'i' && kind != 'u')
    throw InputError(
        fmt::format("{}: numbers of type {}; allowed: whole numbers", name, std::string(py::str(array.dtype()))));
  const auto whole = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>(array);
  Integers integers{{array.shape(), array.shape() + array.ndim()}, {}};
  integers.values.reserve(static_cast<std::size_t>(whole.size()));
  for (py::ssize_t i = 0; i < whole.size(); ++i) {
    const std::int64_t value = whole.data()[i];
    if (value < from || value >= to)
      throw InputError(fmt::format("{}: number {} in C order is {}; allowed: {} to {}", name, i, value, from, to - 1));
    integers.values.push_back(static_cast<int>(value));
  }
  return integers;
}

std::vector<int> indices_from(const py::array& array, const char* name, long to) {
  if (array.ndim() != 1)
    refuse_shape(array, name, "(n,)");
  return integers_from(array, name, 0, to).values;
}

std::vector<Triangle> triangles_from(const py::array& array, std::size_t vertices) {
  if (array.ndim() != 2 || array.shape(1) != 3)
    refuse_shape(array, "triangles", "(n, 3)");
  const Integers flat = integers_from(array, "triangles", 0, static_cast<long>(vertices));
  std::vector<Triangle> triangles(flat.values.size() / 3);
  for (std::size_t t = 0; t < triangles.size(); ++t)
    triangles[t] = {flat.values[3 * t], flat.values[3 * t + 1], flat.values[3 * t + 2]};
  return triangles;
}

std::vector<double> numbers_from(const Doubles& array, const char* name) {
  if (array.ndim() != 1)
    refuse_shape(array, name, "(n,)");
  return {array.data(), array.data() + array.size()};
}

void detail::make_read_only(py::array& array) {
  py::detail::array_proxy(array.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
}

py::array view(const VectorX& values, const py::handle& owner) {
  py::array array = detail::array_at(values.data(), static_cast<std::size_t>(values.size()), owner);
  detail::make_read_only(array);
  return array;
}

py::array view(const MatrixX& values, const py::handle& owner) {
  const auto size = static_cast<py::ssize_t>(sizeof(double));
  py::array array(py::dtype::of<double>(), std::vector<py::ssize_t>{values.rows(), values.cols()},
                  std::vector<py::ssize_t>{size, size * values.rows()}, values.data(), owner);
  detail::make_read_only(array);
  return array;
}

py::array view_by_threes(const VectorX& values, const py::handle& owner) {
  const auto size = static_cast<py::ssize_t>(sizeof(double));
  py::array array(py::dtype::of<double>(), std::vector<py::ssize_t>{values.size() / 3, 3},
                  std::vector<py::ssize_t>{3 * size, size}, values.data(), owner);
  detail::make_read_only(array);
  return array;
}

py::array owned_by_threes(VectorX values) {
  auto kept = std::make_unique<VectorX>(std::move(values));
  const VectorX& memory = *kept;
  const py::capsule base(kept.release(), [](void* p) { delete static_cast<VectorX*>(p); });
  const auto size = static_cast<py::ssize_t>(sizeof(double));
  return py::array(py::dtype::of<double>(), std::vector<py::ssize_t>{memory.size() / 3, 3},
                   std::vector<py::ssize_t>{3 * size, size}, memory.data(), base);
}

py::array owned(MatrixX values) {
  auto kept = std::make_unique<MatrixX>(std::move(values));
  const MatrixX& memory = *kept;
  const py::capsule base(kept.release(), [](void* p) { delete static_cast<MatrixX*>(p); });
  const auto size = static_cast<py::ssize_t>(sizeof(double));
  return py::array(py::dtype::of<double>(), std::vector<py::ssize_t>{memory.rows(), memory.cols()},
                   std::vector<py::ssize_t>{size, size * memory.rows()}, memory.data(), base);
}

py::array array_of(const Vector3& v) {
  return py::array_t<double>(std::vector<py::ssize_t>{3}, v.data());
}

py::array array_of(const Matrix3& m) {
  py::array_t<double> array(std::vector<py::ssize_t>{3, 3});
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(array.mutable_data()) = m;
  return array;
}

py::array bools(const std::vector<char>& values) {
  py::array_t<bool> array(std::vector<py::ssize_t>{static_cast<py::ssize_t>(values.size())});
  for (std::size_t i = 0; i < values.size(); ++i)
    array.mutable_data()[i] = values[i] != 0;
  return array;
}

} // namespace spherecut::bindings
