// Between numpy's arrays and the arrays of the library.
//
// Out of the library there are two kinds. view(): the array is the memory of an object that does not change any more;
// it cannot be written to and keeps the object alive. owned(): the array has taken the memory of a result over. Neither
// copies. Into the library every array is copied once, because the library keeps vectors of its own.
#pragma once

#include "topology/base/types.hpp"

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace spherecut::bindings {

namespace py = pybind11;

/// An array of doubles in C order; whatever numpy can make one of is converted.
using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// (n, 3) finite numbers. Throws InputError naming the array, its shape or the row.
std::vector<Vector3> points_from(const Doubles& array, const char* name);
/// The same of shape (n, 3), or of (3,) for one point.
std::vector<Vector3> one_or_more_points(const Doubles& array, const char* name);
/// (3,) finite numbers. Throws InputError.
Vector3 vector_from(const Doubles& array, const char* name);
/// (3, 3) finite numbers. Throws InputError.
Matrix3 matrix_from(const Doubles& array, const char* name);
/// (n, 2, 3) finite numbers. Throws InputError.
std::vector<std::array<Vector3, 2>> segments_from(const Doubles& array, const char* name);
/// Whole numbers of any shape, row by row, with that shape. Throws InputError when they are not of a type of whole
/// numbers, or below `from` or not below `to`.
struct Integers {
  std::vector<py::ssize_t> shape;
  std::vector<int> values;
};
Integers integers_from(const py::array& array, const char* name, long from, long to);
/// (n,) whole numbers. Throws InputError.
std::vector<int> indices_from(const py::array& array, const char* name, long to);
/// (n, 3) vertex numbers. Throws InputError.
std::vector<Triangle> triangles_from(const py::array& array, std::size_t vertices);
/// (n,) numbers, any of which may be infinite. Throws InputError.
std::vector<double> numbers_from(const Doubles& array, const char* name);

namespace detail {

/// How elements of a vector lie in memory: shape and strides (bytes) behind the first axis, and the type of a number.
template <class T>
struct Element;
template <>
struct Element<double> {
  using Number = double;
  static std::vector<py::ssize_t> shape() { return {}; }
  static std::vector<py::ssize_t> strides() { return {}; }
};
template <>
struct Element<int> {
  using Number = int;
  static std::vector<py::ssize_t> shape() { return {}; }
  static std::vector<py::ssize_t> strides() { return {}; }
};
template <>
struct Element<std::uint8_t> {
  using Number = std::uint8_t;
  static std::vector<py::ssize_t> shape() { return {}; }
  static std::vector<py::ssize_t> strides() { return {}; }
};
template <>
struct Element<Vector3> {
  using Number = double;
  static std::vector<py::ssize_t> shape() { return {3}; }
  static std::vector<py::ssize_t> strides() { return {8}; }
};
template <>
struct Element<Triangle> {
  using Number = int;
  static std::vector<py::ssize_t> shape() { return {3}; }
  static std::vector<py::ssize_t> strides() { return {4}; }
};
template <>
struct Element<std::array<int, 2>> {
  using Number = int;
  static std::vector<py::ssize_t> shape() { return {2}; }
  static std::vector<py::ssize_t> strides() { return {4}; }
};
template <>
struct Element<std::array<Vector3, 2>> {
  using Number = double;
  static std::vector<py::ssize_t> shape() { return {2, 3}; }
  static std::vector<py::ssize_t> strides() { return {24, 8}; }
};
template <>
struct Element<Matrix3> { // Eigen's columns come first
  using Number = double;
  static std::vector<py::ssize_t> shape() { return {3, 3}; }
  static std::vector<py::ssize_t> strides() { return {8, 24}; }
};

template <class T>
py::array array_at(const T* data, std::size_t count, const py::handle& base) {
  using Number = typename Element<T>::Number;
  std::vector<py::ssize_t> shape = Element<T>::shape(), strides = Element<T>::strides();
  shape.insert(shape.begin(), static_cast<py::ssize_t>(count));
  strides.insert(strides.begin(), static_cast<py::ssize_t>(sizeof(T)));
  return py::array(py::dtype::of<Number>(), std::move(shape), std::move(strides), reinterpret_cast<const Number*>(data),
                   base);
}

void make_read_only(py::array& array);

} // namespace detail

/// The memory of a vector that `owner`, a Python object, keeps; cannot be written to.
template <class T>
py::array view(const std::vector<T>& values, const py::handle& owner) {
  py::array array = detail::array_at(values.data(), values.size(), owner);
  detail::make_read_only(array);
  return array;
}
/// (n,) of a vector of Eigen's, and (rows, columns) of a matrix; cannot be written to.
py::array view(const VectorX& values, const py::handle& owner);
py::array view(const MatrixX& values, const py::handle& owner);
/// (n, 3) of a vector of Eigen's with three numbers a node.
py::array view_by_threes(const VectorX& values, const py::handle& owner);

/// An array that takes the memory of the vector over.
template <class T>
py::array owned(std::vector<T> values) {
  auto kept = std::make_unique<std::vector<T>>(std::move(values));
  const std::vector<T>& memory = *kept;
  const py::capsule base(kept.release(), [](void* p) { delete static_cast<std::vector<T>*>(p); });
  return detail::array_at(memory.data(), memory.size(), base);
}
py::array owned_by_threes(VectorX values);
py::array owned(MatrixX values);

/// A vector as an array of its own.
py::array array_of(const Vector3& v);
py::array array_of(const Matrix3& m);

/// (n,) true or false; numpy's bool.
py::array bools(const std::vector<char>& values);

} // namespace spherecut::bindings
