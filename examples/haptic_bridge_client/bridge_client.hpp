// A client of the haptic bridge (docs/haptic_bridge.md, version 2): POSIX sockets and the standard library alone.
#pragma once

#include <arpa/inet.h>
#include <cmath>
#include <cstdint>
#include <sys/socket.h>
#include <unistd.h>

namespace haptic_bridge {

struct Pose { // what goes out: 88 bytes, little endian, nothing between the fields
  std::uint32_t magic = 0x42485053;
  std::uint16_t version = 2, kind = 2; // 1 hello and 3 goodbye are the first 16 bytes alone
  std::uint64_t token = 0, sequence = 0;
  double position[3] = {}, orientation[4] = {0, 0, 0, 1}; // m; x, y, z, w
  std::uint16_t mode = 0, buttons = 0;
  std::uint32_t zero = 0;
};
struct Force { // what comes in: 112 bytes; in version 1 it ends before the torque
  std::uint32_t magic = 0;
  std::uint16_t version = 0, kind = 0;
  std::uint64_t token = 0, tick = 0, sequence = 0;
  double force[3] = {}, position[3] = {}, timeout = 0; // N, m, s
  double torque[3] = {};                               // N m
};
static_assert(sizeof(Pose) == 88 && sizeof(Force) == 112, "packets have no gaps");

/// Where a device is, in the axes of the scenario.
struct Motion {
  double position[3] = {};              // m, from wherever the device counts
  double orientation[4] = {0, 0, 0, 1}; // x, y, z, w, from wherever the device counts
  std::uint16_t mode = 0, buttons = 0;
};

class Client {
 public:
  explicit Client(int port = 27510, const char* address = "127.0.0.1") : link_(socket(AF_INET, SOCK_DGRAM, 0)) {
    sockaddr_in bridge{};
    bridge.sin_family = AF_INET;
    bridge.sin_port = htons(static_cast<std::uint16_t>(port));
    open_ = link_ >= 0 && inet_pton(AF_INET, address, &bridge.sin_addr) == 1 &&
            connect(link_, reinterpret_cast<sockaddr*>(&bridge), sizeof bridge) == 0;
  }
  /// Lets the tool go.
  ~Client() {
    pose_.kind = 3;
    if (open_)
      send(link_, &pose_, 16, MSG_DONTWAIT);
    if (link_ >= 0)
      close(link_);
  }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  bool open() const { return open_; }
  /// Says where the device is and gives the newest force on the hand, N; none while nobody answers. Once a
  /// millisecond; it never waits. The device's motion since the session began is added to where the tool waited, and
  /// its turn since then turns a tool whose axis is +z.
  const double* exchange(const Motion& motion) {
    for (Force next; recv(link_, &next, sizeof next, MSG_DONTWAIT) == sizeof next;)
      if (next.magic == pose_.magic && next.version == pose_.version && next.kind == 4) {
        if (next.token != session_) {
          for (int axis = 0; axis < 3; ++axis)
            start_[axis] = next.position[axis] - motion.position[axis];
          for (int i = 0; i < 4; ++i)
            unturned_[i] = (i < 3 ? -1 : 1) * motion.orientation[i];
        }
        pose_.token = session_ = next.token;
        force_ = next;
        silent_ = 0;
        ++heard_;
      }
    if (++silent_ > 100) // nobody answers
      pose_.token = 0;
    for (int axis = 0; axis < 3; ++axis)
      pose_.position[axis] = start_[axis] + motion.position[axis];
    turn(motion.orientation, unturned_, pose_.orientation);
    pose_.mode = motion.mode;
    pose_.buttons = motion.buttons;
    ++pose_.sequence;
    pose_.kind = pose_.token != 0 ? 2 : 1;
    send(link_, &pose_, pose_.kind == 2 ? sizeof pose_ : 16, MSG_DONTWAIT);
    return pose_.token != 0 ? force_.force : none_;
  }
  /// The torque that belongs to that force, about the tool's reference point, N m.
  const double* torque() const { return held() ? force_.torque : none_; }
  /// Forces that have come.
  long heard() const { return heard_; }
  /// Whether a session goes on.
  bool held() const { return pose_.token != 0; }

 private:
  /// The second turn first.
  static void turn(const double a[4], const double b[4], double product[4]) {
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      product[i] = a[3] * b[i] + b[3] * a[i] + a[j] * b[k] - a[k] * b[j];
    }
    product[3] = a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2];
  }

  int link_;
  bool open_ = false;
  Pose pose_;
  Force force_;
  double start_[3] = {}, unturned_[4] = {0, 0, 0, 1}, none_[3] = {}; // of the motion, its inverse turn, no force
  long heard_ = 0, silent_ = 0;
  std::uint64_t session_ = 0; // the token of the last one
};

/// Between a device's axes and the scenario's: rows are the scenario's axes in the device's.
class Axes {
 public:
  constexpr Axes(const double (&rows)[3][3]) : m_{} {
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        m_[i][j] = rows[i][j];
  }
  /// `scale`: metres in the device's unit of length. `rotation` of the handle in the device's axes: m = R e in them.
  void to_scenario(const double position[3], double scale, const double rotation[3][3], Motion& motion) const {
    double turned[3][3] = {}; // m_ R m_^T
    for (int i = 0; i < 3; ++i) {
      motion.position[i] = 0;
      for (int j = 0; j < 3; ++j) {
        motion.position[i] += scale * m_[i][j] * position[j];
        for (int k = 0; k < 3; ++k)
          for (int l = 0; l < 3; ++l)
            turned[i][j] += m_[i][k] * rotation[k][l] * m_[j][l];
      }
    }
    quaternion_of(turned, motion.orientation);
  }
  void to_device(const double force[3], double turned[3]) const {
    for (int j = 0; j < 3; ++j)
      turned[j] = m_[0][j] * force[0] + m_[1][j] * force[1] + m_[2][j] * force[2];
  }

  /// x, y, z, w of a rotation; by the largest of the four, so that nothing is divided by a small number.
  static void quaternion_of(const double r[3][3], double q[4]) {
    const double trace = r[0][0] + r[1][1] + r[2][2];
    int largest = 3;
    for (int i = 0; i < 3; ++i)
      if (r[i][i] > (largest == 3 ? trace : r[largest][largest]))
        largest = i;
    if (largest == 3) {
      const double s = 2 * std::sqrt(1 + trace);
      q[0] = (r[2][1] - r[1][2]) / s;
      q[1] = (r[0][2] - r[2][0]) / s;
      q[2] = (r[1][0] - r[0][1]) / s;
      q[3] = s / 4;
    } else {
      const int i = largest, j = (i + 1) % 3, k = (i + 2) % 3;
      const double s = 2 * std::sqrt(1 + r[i][i] - r[j][j] - r[k][k]);
      q[i] = s / 4;
      q[j] = (r[j][i] + r[i][j]) / s;
      q[k] = (r[k][i] + r[i][k]) / s;
      q[3] = (r[k][j] - r[j][k]) / s;
    }
  }

 private:
  double m_[3][3];
};

} // namespace haptic_bridge
