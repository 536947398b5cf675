// Stands in for the service of an Inverse3: says what its documentation says that it says (docs/devices.md), and checks
// what it is told.
#pragma once

#include <array>
#include <memory>
#include <string>

namespace spherecut::tests {

/// The state that the service begins with, as documented: one Inverse3, "049D".
std::string haply_inventory();

class HaplyService {
 public:
  using Vector = std::array<double, 3>;

  /// Listens on 127.0.0.1; port 0: any free one. The cursor is in m.
  explicit HaplyService(int port = 0, const Vector& cursor = {0, -0.12, 0.15});
  ~HaplyService();
  HaplyService(const HaplyService&) = delete;
  HaplyService& operator=(const HaplyService&) = delete;

  [[nodiscard]] int port() const;
  [[nodiscard]] std::string address() const;

  void set_cursor(const Vector& cursor);   // m
  void set_fall(double step, double most); // m, by which the cursor falls with each message, and in all
  void set_grip(const std::array<double, 4>& turn, bool pressed); // w, x, y, z; from now on there is a wireless one
  void set_silent(bool silent);                                   // messages are taken and not answered
  void set_plugged(bool plugged);                                 // false: the Inverse3 has gone, the service has not
  void set_pause(int milliseconds);                               // before each answer
  void close_after(int messages);                                 // ends connection and service
  void set_nonsense(bool nonsense);                               // answers are no JSON

  /// Forces told, N: the newest, the largest upward one.
  [[nodiscard]] Vector force() const;
  [[nodiscard]] double peak() const;
  /// Messages so far; those that were not as documented; those that named the session; connections.
  [[nodiscard]] int messages() const;
  [[nodiscard]] int refused() const;
  [[nodiscard]] int named() const;
  [[nodiscard]] int connections() const;
  /// Whether the last connection was closed by its client as the protocol has it.
  [[nodiscard]] bool closed_well() const;

 private:
  struct Data;
  std::unique_ptr<Data> data_;
};

/// A port of this machine where nobody listens.
int free_port();

} // namespace spherecut::tests
