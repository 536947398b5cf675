#include "src/viewer/wire.hpp"

#include <algorithm>
#include <bit>
#include <cstring>
#include <initializer_list>

namespace spherecut::app {
namespace {

static_assert(std::endian::native == std::endian::little, "messages are little-endian");

constexpr std::uint8_t topology_message = 1;
constexpr std::uint8_t frame_message = 2;

enum class WireSection : std::uint32_t {
  rest_vertices = 1,
  triangles = 2,
  vertex_tags = 3,
  triangle_parts = 4,
  triangle_pieces = 5,
  lip_pairs = 6,
  vertices = 16,
  colours = 17,
  nodes = 18,
  picked_node = 19,
  slice = 20,
  volumes = 21,
  stages = 22,
  second_hand = 23,
};

class Writer {
 public:
  template <typename T>
  void put(T value) {
    static_assert(std::is_trivially_copyable_v<T>);
    const std::size_t at = bytes_.size();
    bytes_.resize(at + sizeof value);
    std::memcpy(bytes_.data() + at, &value, sizeof value);
  }
  void put_float(double value) { put(static_cast<float>(value)); }
  void put_floats(std::initializer_list<double> values) {
    for (const double value : values)
      put_float(value);
  }
  void put_vector(const Vector3& x) { put_floats({x.x(), x.y(), x.z()}); }
  template <typename T>
  void put_all(const std::vector<T>& values) {
    static_assert(std::is_trivially_copyable_v<T> || std::is_same_v<T, Eigen::Vector3f>);
    const std::size_t at = bytes_.size();
    bytes_.resize(at + values.size() * sizeof(T));
    if (!values.empty())
      std::memcpy(bytes_.data() + at, static_cast<const void*>(values.data()), values.size() * sizeof(T));
  }

  void header(std::uint8_t type, int version, std::uint32_t message, std::uint32_t epoch) {
    put(type);
    put(static_cast<std::uint8_t>(version));
    put(std::uint16_t{0}); // offset of the first section, and length: known later
    put(std::uint32_t{0});
    put(message);
    put(epoch);
  }
  void end_block() { set(2, static_cast<std::uint16_t>(bytes_.size())); }

  void begin(WireSection kind) {
    put(static_cast<std::uint32_t>(kind));
    put(std::uint32_t{0});
    start_ = bytes_.size();
  }
  void end() {
    set(start_ - 4, static_cast<std::uint32_t>(bytes_.size() - start_));
    bytes_.resize((bytes_.size() + 3) / 4 * 4, '\0');
  }
  template <typename T>
  void section(WireSection kind, const std::vector<T>& values) {
    begin(kind);
    put_all(values);
    end();
  }

  std::string finish() {
    set(4, static_cast<std::uint32_t>(bytes_.size()));
    return std::move(bytes_);
  }
  void reserve(std::size_t bytes) { bytes_.reserve(bytes); }

 private:
  template <typename T>
  void set(std::size_t at, T value) {
    std::memcpy(bytes_.data() + at, &value, sizeof value);
  }
  std::string bytes_;
  std::size_t start_ = 0;
};

static_assert(sizeof(Eigen::Vector3f) == 12 && sizeof(Triangle) == 12 && sizeof(std::array<int, 2>) == 8);

void put_block(const ViewerFrame& frame, const LiveTick& tick, const FrameContext& context, Writer& out) {
  const TickRecord& record = tick.record;
  const Eigen::Quaterniond& turn = record.device.orientation;
  out.put(frame.time);
  out.put(record.device.time);
  out.put(frame.topology ? frame.topology->number : std::uint32_t{0});
  out.put(static_cast<std::uint32_t>(frame.solve));
  out.put(static_cast<std::uint32_t>(frame.vertices.size()));
  out.put(context.state);
  out.put(static_cast<std::uint32_t>(std::max(1, static_cast<int>(record.device.mode)) - 1));
  out.put(tick.hand.number);
  out.put(context.number_in_solve);
  out.put(static_cast<std::uint32_t>(frame.topology ? frame.topology->volumes.size() : 0));
  out.put_vector(tick.hand.position);
  out.put_vector(record.device.position);
  out.put_floats({turn.x(), turn.y(), turn.z(), turn.w()});
  out.put_vector(tick.axis);
  out.put_vector(record.tissue);
  out.put_vector(record.force);
  out.put_vector(tick.contact.point);
  out.put_vector(tick.contact.normal);
  out.put_float(record.depth);
  out.put_float(frame.contact_radius);
  out.put(static_cast<std::uint32_t>(record.active));
  out.put(static_cast<std::uint32_t>(frame.nodes));
  out.put(static_cast<std::uint32_t>(frame.degradation));
  out.put_floats({context.rates.ticks, context.rates.solves, context.rates.pictures, context.rates.tick_seconds});
  out.put(static_cast<std::uint32_t>(record.device.tick));
  out.put(static_cast<std::uint32_t>(tick.overruns));
  out.put_floats({tick.worst_latency, frame.solve_seconds, frame.cut_area, frame.front_length, frame.opening,
                  frame.opening_volume, record.energy, frame.largest_displacement});
  out.put(context.left_out);
  out.put(std::uint32_t{0});
  if (context.version < 2)
    return;
  out.put_vector(record.tissue_torque);
  out.put_vector(record.torque);
}

void put_second_hand(const SecondHandRecord& hand, const LiveTick& tick, const FrameContext& context, Writer& out) {
  const Eigen::Quaterniond& turn = hand.device.orientation;
  out.begin(WireSection::second_hand);
  out.put(tick.second_hand.number);
  out.put(context.second_number_in_solve);
  out.put_vector(tick.second_hand.position);
  out.put_vector(hand.device.position);
  out.put_floats({turn.x(), turn.y(), turn.z(), turn.w()});
  for (const Vector3& x : {hand.tissue, hand.force, hand.tissue_torque, hand.torque})
    out.put_vector(x);
  out.put_float(tick.second_depth);
  out.put_float(hand.energy);
  out.end();
}

void put_colours(std::uint32_t quantity, const std::vector<float>& values, Writer& out) {
  if (values.empty())
    return;
  const auto [least, most] = std::minmax_element(values.begin(), values.end());
  out.begin(WireSection::colours);
  out.put(quantity);
  out.put(*least);
  out.put(*most);
  out.put_all(values);
  out.end();
}

void put_nodes(const std::vector<ViewerFrame::Node>& list, Writer& out) {
  out.begin(WireSection::nodes);
  out.put(static_cast<std::uint32_t>(list.size()));
  for (const ViewerFrame::Node& node : list) {
    for (int axis = 0; axis < 3; ++axis)
      out.put(node.position[axis]);
    out.put(node.radius);
  }
  for (const ViewerFrame::Node& node : list)
    out.put(static_cast<std::uint8_t>(node.kind));
  out.end();
}

void put_pick(const PickedNode& pick, Writer& out) {
  out.begin(WireSection::picked_node);
  out.put(static_cast<std::uint32_t>(pick.node));
  out.put(static_cast<std::uint32_t>(pick.seen.size()));
  out.put(static_cast<std::uint32_t>(pick.hidden.size()));
  out.put_vector(pick.position);
  out.put_float(pick.radius);
  out.put_all(pick.seen);
  out.put_all(pick.hidden);
  out.end();
}

void put_slice(const FieldSlice& field, Writer& out) {
  out.begin(WireSection::slice);
  out.put(static_cast<std::uint32_t>(field.count));
  for (const Vector3& x : {field.corner, field.along, field.up})
    out.put_vector(x);
  out.put_all(field.organ);
  out.put_all(field.cut);
  out.end();
}

void put_picture(const ViewerFrame& frame, const Overlays& overlays, int client, Writer& out) {
  out.section(WireSection::vertices, frame.vertices);
  if (overlays.colour == Overlays::Colour::displacement)
    put_colours(1, frame.displacement, out);
  if (overlays.colour == Overlays::Colour::von_mises)
    put_colours(2, frame.von_mises, out);
  if (overlays.nodes && !frame.node_list.empty())
    put_nodes(frame.node_list, out);
  for (const PickedNode& pick : frame.picks)
    if (overlays.pick && pick.key == client)
      put_pick(pick, out);
  for (const FieldSlice& field : frame.slices)
    if (overlays.slice && field.key == client)
      put_slice(field, out);
  out.begin(WireSection::volumes);
  for (const double volume : frame.topology->volumes)
    out.put_float(volume);
  out.end();
}

} // namespace

std::string encode_topology(const ViewerTopology& topology, int version, std::uint32_t message, std::uint32_t epoch) {
  Writer out;
  out.reserve(64 + 13 * topology.vertices.size() + 15 * topology.triangles.size() + 8 * topology.lip_pairs.size() + 96);
  out.header(topology_message, version, message, epoch);
  out.put(topology.number);
  out.put(static_cast<std::uint32_t>(topology.vertices.size()));
  out.put(static_cast<std::uint32_t>(topology.triangles.size()));
  out.put(static_cast<std::uint32_t>(topology.volumes.size()));
  out.end_block();
  out.section(WireSection::rest_vertices, topology.vertices);
  out.section(WireSection::triangles, topology.triangles);
  out.section(WireSection::vertex_tags, topology.tags);
  out.section(WireSection::triangle_parts, topology.parts);
  out.section(WireSection::triangle_pieces, topology.pieces);
  out.section(WireSection::lip_pairs, topology.lip_pairs);
  return out.finish();
}

std::string encode_frame(const ViewerFrame& frame, const LiveTick& tick, const FrameContext& context,
                         const Overlays& overlays, int client, bool with_vertices) {
  Writer out;
  out.reserve(512 + (with_vertices ? 16 * frame.vertices.size() + 20 * frame.node_list.size() : 0));
  out.header(frame_message, context.version, context.message, context.epoch);
  put_block(frame, tick, context, out);
  out.end_block();
  if (with_vertices && frame.topology)
    put_picture(frame, overlays, client, out);
  if (tick.record.second)
    put_second_hand(*tick.record.second, tick, context, out);
  if (overlays.stages) {
    const SessionProfile& profile = frame.profile;
    out.begin(WireSection::stages);
    out.put_floats({profile.press, profile.sprinkle, profile.discretise, profile.condense, profile.topology,
                    profile.level_sets, profile.evaluate, frame.picture_seconds});
    out.end();
  }
  return out.finish();
}

} // namespace spherecut::app
