// What the clients of the bridge share: a device's axes turned into the scenario's, and a session as its client has it.
#include "examples/haptic_bridge_client/bridge_client.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <random>

using haptic_bridge::Axes;
using haptic_bridge::Client;
using haptic_bridge::Force;
using haptic_bridge::Motion;
using haptic_bridge::Pose;

namespace {

Eigen::Quaterniond quaternion(const double (&q)[4]) {
  return {q[3], q[0], q[1], q[2]};
}

/// A bridge that answers by hand. Loopback delivers before send() returns.
class Bridge {
 public:
  Bridge() : socket_(::socket(AF_INET, SOCK_DGRAM, 0)) {
    own_.sin_family = AF_INET;
    own_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof own_;
    REQUIRE(::bind(socket_, reinterpret_cast<const sockaddr*>(&own_), size) == 0);
    REQUIRE(::getsockname(socket_, reinterpret_cast<sockaddr*>(&own_), &size) == 0);
  }
  ~Bridge() { ::close(socket_); }
  Bridge(const Bridge&) = delete;
  Bridge& operator=(const Bridge&) = delete;

  [[nodiscard]] int port() const { return ntohs(own_.sin_port); }
  /// The next packet; its size, or less than 0 when there is none.
  ssize_t take(Pose& pose) {
    socklen_t size = sizeof from_;
    return ::recvfrom(socket_, &pose, sizeof pose, MSG_DONTWAIT, reinterpret_cast<sockaddr*>(&from_), &size);
  }
  void answer(std::uint64_t token, const double (&place)[3], double force) {
    Force packet;
    packet.magic = 0x42485053;
    packet.version = 2;
    packet.kind = 4;
    packet.token = token;
    packet.force[2] = force;
    packet.torque[0] = 0.01 * force;
    for (int axis = 0; axis < 3; ++axis)
      packet.position[axis] = place[axis];
    REQUIRE(::sendto(socket_, &packet, sizeof packet, 0, reinterpret_cast<const sockaddr*>(&from_), sizeof from_) ==
            sizeof packet);
  }

 private:
  int socket_;
  sockaddr_in own_{}, from_{};
};

} // namespace

TEST_CASE("A device's axes become the scenario's, places and turns there and forces back") {
  constexpr double rows[3][3] = {{1, 0, 0}, {0, 0, -1}, {0, 1, 0}};
  constexpr Axes axes(rows);
  Eigen::Matrix3d m;
  m << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 3000; ++trial) {
    Eigen::Quaterniond q(normal(random), normal(random), normal(random), normal(random));
    if (trial % 2 == 0) // half turns, of which the real part is no help
      q = Eigen::Quaterniond(1e-9 * q.w(), trial % 3 == 0 ? q.x() : 0, trial % 3 == 1 ? q.y() : 0,
                             trial % 3 == 2 ? q.z() : 0);
    const Eigen::Matrix3d r = q.normalized().toRotationMatrix();
    double rotation[3][3];
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        rotation[i][j] = r(i, j);
    const Eigen::Vector3d p(normal(random), normal(random), normal(random));
    Motion motion;
    axes.to_scenario(p.data(), 1e-3, rotation, motion);
    CHECK((quaternion(motion.orientation).toRotationMatrix() - m * r * m.transpose()).norm() < 1e-12);
    CHECK((Eigen::Vector3d(motion.position) - 1e-3 * m * p).norm() < 1e-12);
    Eigen::Vector3d back;
    axes.to_device(p.data(), back.data());
    CHECK((back - m.transpose() * p).norm() < 1e-12);
  }
}

TEST_CASE(
    "A client says hello, adds its motion and turns to where the tool waits, and begins anew with a new session") {
  Bridge bridge;
  Client client(bridge.port());
  REQUIRE(client.open());
  Motion motion;
  motion.position[0] = 5;
  const double half = std::sqrt(0.5);
  const auto turn = [&](double x, double w) {
    motion.orientation[0] = x;
    motion.orientation[3] = w;
  };
  turn(half, half);
  CHECK(client.exchange(motion)[2] == 0);
  Pose pose;
  REQUIRE(bridge.take(pose) == 16);
  CHECK(pose.kind == 1);
  bridge.answer(77, {0.1, 0.2, 0.3}, 2);
  CHECK(client.exchange(motion)[2] == 2);
  CHECK(client.torque()[0] == Approx(0.02));
  REQUIRE(bridge.take(pose) == 88);
  CHECK(pose.kind == 2);
  CHECK(pose.token == 77);
  CHECK(pose.position[0] == Approx(0.1));
  CHECK(pose.position[2] == Approx(0.3));
  CHECK(quaternion(pose.orientation).angularDistance(Eigen::Quaterniond::Identity()) < 1e-7);
  motion.position[0] = 5.01;
  turn(1, 0);
  client.exchange(motion);
  REQUIRE(bridge.take(pose) == 88);
  CHECK(pose.position[0] == Approx(0.11));
  const Eigen::Quaterniond quarter(half, half, 0, 0);
  CHECK(quaternion(pose.orientation).angularDistance(quarter) < 1e-7);
  for (int i = 0; i < 101; ++i)
    client.exchange(motion);
  CHECK_FALSE(client.held());
  CHECK(client.exchange(motion)[2] == 0); // nobody has answered for a while
  CHECK(client.torque()[0] == 0);
  while (bridge.take(pose) > 16) {
  }
  REQUIRE(bridge.take(pose) == 16);
  bridge.answer(78, {0, 0, 0}, 1);
  client.exchange(motion);
  while (bridge.take(pose) > 0 && pose.kind != 2) {
  }
  CHECK(pose.token == 78);
  CHECK(pose.position[0] == Approx(0).margin(1e-12));
  CHECK(quaternion(pose.orientation).angularDistance(Eigen::Quaterniond::Identity()) < 1e-7);
}
