// A value that may be missing, for records that threads copy at every tick.
#pragma once

namespace spherecut::app {

/// std::optional whose missing value is a default one, so that a copy reads no memory that was never written. T is
/// default constructible and cheap to copy.
template <typename T>
class Possible {
 public:
  Possible() = default;
  Possible& operator=(const T& value) noexcept {
    value_ = value;
    has_value_ = true;
    return *this;
  }
  void reset() noexcept { *this = Possible(); }

  [[nodiscard]] bool has_value() const noexcept { return has_value_; }
  explicit operator bool() const noexcept { return has_value_; }
  [[nodiscard]] const T& operator*() const noexcept { return value_; }
  [[nodiscard]] T& operator*() noexcept { return value_; }
  [[nodiscard]] const T* operator->() const noexcept { return &value_; }
  [[nodiscard]] T* operator->() noexcept { return &value_; }
  [[nodiscard]] T value_or(const T& other) const noexcept { return has_value_ ? value_ : other; }

 private:
  T value_{};
  bool has_value_ = false;
};

} // namespace spherecut::app
