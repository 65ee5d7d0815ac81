// The names of godot-cpp that the extension uses, with the signatures and the arithmetic that Godot documents, so that
// the extension compiles and runs in a test. None of Godot's code is here: what only Godot can show, this cannot. That
// the extension compiles with godot-cpp itself is scripts/test_godot.sh's to show.
#ifndef DCLOTH_TESTS_GODOT_STAND_IN_GODOT_H_
#define DCLOTH_TESTS_GODOT_STAND_IN_GODOT_H_

#include <any>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

namespace godot {

using real_t = float;
enum Error { OK = 0, ERR_FILE_NOT_FOUND = 7, ERR_FILE_CORRUPT = 16 };

class CharString {
 public:
  explicit CharString(std::string text) : text_(std::move(text)) {}
  const char* get_data() const { return text_.c_str(); }

 private:
  std::string text_;
};

class String {
 public:
  String(const char* text = "") : text_(text) {}  // NOLINT: implicit there too
  static String utf8(const char* text) { return text; }
  CharString utf8() const { return CharString(text_); }
  bool is_empty() const { return text_.empty(); }
  String get_extension() const {
    const size_t dot = text_.rfind('.');
    return dot == std::string::npos ? "" : text_.c_str() + dot + 1;
  }
  String to_lower() const {
    String lower = *this;
    for (char& c : lower.text_) c = static_cast<char>(std::tolower(c));
    return lower;
  }
  const std::string& text() const { return text_; }
  friend bool operator==(const String& a, const String& b) { return a.text_ == b.text_; }

 private:
  std::string text_;
};
class StringName : public String {
 public:
  using String::String;
  StringName(const String& text) : String(text) {}  // NOLINT
};
class NodePath : public String {
 public:
  using String::String;
};

struct Vector2 {
  Vector2() = default;
  Vector2(real_t a, real_t b) : x(a), y(b) {}
  real_t x = 0, y = 0;
};
struct Vector3 {
  real_t x = 0, y = 0, z = 0;
  Vector3() = default;
  Vector3(real_t x_, real_t y_, real_t z_) : x(x_), y(y_), z(z_) {}
  Vector3 operator+(const Vector3& v) const { return {x + v.x, y + v.y, z + v.z}; }
  Vector3 operator*(real_t s) const { return {x * s, y * s, z * s}; }
  real_t dot(const Vector3& v) const { return x * v.x + y * v.y + z * v.z; }
  Vector3 cross(const Vector3& v) const { return {y * v.z - z * v.y, z * v.x - x * v.z, x * v.y - y * v.x}; }
  // The octahedron |x| + |y| + |z| = 1, its lower half folded out, in [0, 1].
  Vector2 octahedron_encode() const {
    const real_t sum = std::abs(x) + std::abs(y) + std::abs(z);
    real_t u = x / sum, v = y / sum;
    if (z < 0) {
      const real_t folded = (1 - std::abs(v)) * (u >= 0 ? 1.0f : -1.0f);
      v = (1 - std::abs(u)) * (v >= 0 ? 1.0f : -1.0f);
      u = folded;
    }
    return {u * 0.5f + 0.5f, v * 0.5f + 0.5f};
  }
};
struct Basis {
  Vector3 rows[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  Vector3 get_column(int c) const {
    const auto at = [c](const Vector3& row) { return c == 0 ? row.x : c == 1 ? row.y : row.z; };
    return {at(rows[0]), at(rows[1]), at(rows[2])};
  }
  Vector3 xform(const Vector3& v) const { return {rows[0].dot(v), rows[1].dot(v), rows[2].dot(v)}; }
  Basis operator*(const Basis& b) const {
    Basis product;
    for (int r = 0; r < 3; ++r) {
      product.rows[r] = {rows[r].dot(b.get_column(0)), rows[r].dot(b.get_column(1)), rows[r].dot(b.get_column(2))};
    }
    return product;
  }
  Basis inverse() const {
    const Vector3 x = get_column(0), y = get_column(1), z = get_column(2);
    const real_t scale = 1 / x.dot(y.cross(z));
    Basis result;
    result.rows[0] = y.cross(z) * scale, result.rows[1] = z.cross(x) * scale, result.rows[2] = x.cross(y) * scale;
    return result;
  }
};
struct Transform3D {
  Basis basis;
  Vector3 origin;
  Transform3D() = default;
  Transform3D(const Basis& b, const Vector3& o) : basis(b), origin(o) {}
  Vector3 xform(const Vector3& v) const { return basis.xform(v) + origin; }
  Transform3D operator*(const Transform3D& b) const { return {basis * b.basis, xform(b.origin)}; }
  Transform3D affine_inverse() const {
    const Basis back = basis.inverse();
    return {back, back.xform(origin) * -1};
  }
};
struct AABB {
  Vector3 position, size;
  AABB() = default;
  AABB(const Vector3& p, const Vector3& s) : position(p), size(s) {}
};

template <typename T>
class PackedArray {
 public:
  int64_t size() const { return static_cast<int64_t>(items_.size()); }
  bool is_empty() const { return items_.empty(); }
  const T* ptr() const { return items_.data(); }
  T* ptrw() { return items_.data(); }
  void resize(int64_t count) { items_.resize(static_cast<size_t>(count)); }
  void fill(const T& value) { items_.assign(items_.size(), value); }
  void push_back(const T& value) { items_.push_back(value); }
  const T& operator[](int64_t i) const { return items_.at(static_cast<size_t>(i)); }

 private:
  std::vector<T> items_;
};
using PackedByteArray = PackedArray<uint8_t>;
using PackedInt32Array = PackedArray<int32_t>;
using PackedFloat32Array = PackedArray<float>;
using PackedVector2Array = PackedArray<Vector2>;
using PackedVector3Array = PackedArray<Vector3>;
using PackedStringArray = PackedArray<String>;

class Variant {
 public:
  enum Type { BOOL, INT, VECTOR3, NODE_PATH, OBJECT };
  Variant() = default;
  template <typename T>
  Variant(const T& value) : value_(value) {}  // NOLINT: implicit there too
  // A null value gives an empty array, as there.
  template <typename T>
  operator T() const {  // NOLINT
    return value_.has_value() ? std::any_cast<T>(value_) : T();
  }

 private:
  std::any value_;
};
class Array {
 public:
  void resize(int64_t count) { items_.resize(static_cast<size_t>(count)); }
  Variant& operator[](int64_t i) { return items_.at(static_cast<size_t>(i)); }
  const Variant& operator[](int64_t i) const { return items_.at(static_cast<size_t>(i)); }

 private:
  std::vector<Variant> items_;
};
template <typename T>
class TypedArray : public Array {};
class Dictionary {
 public:
  Variant& operator[](const char* key) { return items_[key]; }
  size_t size() const { return items_.size(); }

 private:
  std::map<std::string, Variant> items_;
};

// What calls defer and what is printed, until a test looks.
inline std::vector<std::function<void()>>& Deferred() {
  static std::vector<std::function<void()>> calls;
  return calls;
}
inline void Flush() {
  const std::vector<std::function<void()>> calls = std::move(Deferred());
  Deferred().clear();
  for (const auto& call : calls) call();
}
inline std::vector<std::string>& Printed() {
  static std::vector<std::string> lines;
  return lines;
}
struct UtilityFunctions {
  template <typename... T>
  static void push_error(const T&... parts) {
    std::string line;
    ((line += String(parts).text()), ...);
    Printed().push_back(line);
  }
};

class Callable {
 public:
  Callable(std::string identity, std::function<void(double)> call)
      : identity_(std::move(identity)), call_(std::move(call)) {}
  void call() const { call_(0); }
  template <typename... T>
  void call_deferred(const T&... arguments) const {
    Deferred().push_back([call = call_, arguments...] { call((0.0 + ... + arguments)); });
  }
  bool operator==(const Callable& other) const { return identity_ == other.identity_; }

 private:
  std::string identity_;
  std::function<void(double)> call_;
};
template <typename C, typename... P>
Callable callable_mp(C* object, void (C::*method)(P...)) {
  std::string identity(sizeof(object) + sizeof(method), '\0');
  std::memcpy(identity.data(), &object, sizeof(object));
  std::memcpy(identity.data() + sizeof(object), &method, sizeof(method));
  return {identity, [object, method](double argument) {
            if constexpr (sizeof...(P) == 0) {
              (object->*method)();
            } else {
              (object->*method)(argument);
            }
          }};
}

#define GDCLASS(Class, Base)                                       \
 public:                                                           \
  static ::godot::StringName get_class_static() { return #Class; } \
  static void Bind() { _bind_methods(); }                          \
  void Notify(int what) { _notification(what); }                   \
                                                                   \
 private:
#define VARIANT_ENUM_CAST(Enum) static_assert(true)

class Object;
struct ObjectDB {
  static std::map<uint64_t, Object*>& All() {
    static std::map<uint64_t, Object*> objects;
    return objects;
  }
  static Object* get_instance(uint64_t id) { return All().count(id) != 0 ? All()[id] : nullptr; }
};
class Object {
 public:
  Object() : id_(++Last()) { ObjectDB::All()[id_] = this; }
  virtual ~Object() { ObjectDB::All().erase(id_); }
  Object(const Object&) = delete;
  Object& operator=(const Object&) = delete;
  template <typename T>
  static T* cast_to(Object* object) {
    return dynamic_cast<T*>(object);
  }
  uint64_t get_instance_id() const { return id_; }
  void connect(const StringName& signal, const Callable& call) { signals_.emplace_back(signal.text(), call); }
  bool is_connected(const StringName& signal, const Callable& call) const {
    for (const auto& [name, other] : signals_) {
      if (name == signal.text() && other == call) return true;
    }
    return false;
  }
  void disconnect(const StringName& signal, const Callable& call) {
    std::erase_if(signals_, [&](const auto& entry) { return entry.first == signal.text() && entry.second == call; });
  }
  void Emit(const std::string& signal) {
    for (const auto& [name, call] : signals_) {
      if (name == signal) call.call();
    }
  }

 protected:
  void _notification(int) {}

 private:
  static uint64_t& Last() {
    static uint64_t last = 0;
    return last;
  }
  uint64_t id_;
  std::vector<std::pair<std::string, Callable>> signals_;
};

template <typename T>
class Ref {
 public:
  Ref() = default;
  template <typename U>
  Ref(const Ref<U>& other) : object_(std::dynamic_pointer_cast<T>(other.object_)) {}  // NOLINT
  void instantiate() { object_ = std::make_shared<T>(); }
  bool is_null() const { return object_ == nullptr; }
  T* operator->() const { return object_.get(); }
  T* operator*() const { return object_.get(); }

 private:
  template <typename U>
  friend class Ref;
  std::shared_ptr<T> object_;
};

// What classes say of themselves.
enum PropertyHint {
  PROPERTY_HINT_NONE,
  PROPERTY_HINT_ENUM,
  PROPERTY_HINT_NODE_PATH_VALID_TYPES,
  PROPERTY_HINT_RESOURCE_TYPE
};
struct PropertyInfo {
  PropertyInfo(Variant::Type, const char* name_, PropertyHint, const char*) : name(name_) {}
  std::string name;
};
#define D_METHOD(...) std::vector<std::string>({__VA_ARGS__})
#define BIND_ENUM_CONSTANT(Constant) ::godot::ClassDB::Constants().insert(#Constant)
struct ClassDB {
  static std::set<std::string>& Methods() {
    static std::set<std::string> names;
    return names;
  }
  static std::set<std::string>& Constants() {
    static std::set<std::string> names;
    return names;
  }
  static std::map<std::string, std::pair<std::string, std::string>>& Properties() {
    static std::map<std::string, std::pair<std::string, std::string>> accessors;
    return accessors;
  }
  template <typename C, typename R, typename... P>
  static void bind_method(const std::vector<std::string>& name, R (C::*)(P...)) {
    if (name.size() == 1 + sizeof...(P)) Methods().insert(name[0]);
  }
  template <typename C, typename R, typename... P>
  static void bind_method(const std::vector<std::string>& name, R (C::*)(P...) const) {
    if (name.size() == 1 + sizeof...(P)) Methods().insert(name[0]);
  }
  static void add_property(const StringName&, const PropertyInfo& info, const char* setter, const char* getter) {
    Properties()[info.name] = {setter, getter};
  }
};

class Engine {
 public:
  static Engine* get_singleton() {
    static Engine engine;
    return &engine;
  }
  bool is_editor_hint() const { return editor; }
  bool editor = false;
};

class Resource : public Object {
 public:
  void emit_changed() { Emit("changed"); }
};
class ResourceFormatLoader : public Resource {
 public:
  virtual PackedStringArray _get_recognized_extensions() const = 0;
  virtual bool _handles_type(const StringName&) const = 0;
  virtual String _get_resource_type(const String&) const = 0;
  virtual Variant _load(const String&, const String&, bool, int32_t) const = 0;
};
struct FileAccess {
  static std::map<std::string, std::vector<uint8_t>>& Files() {
    static std::map<std::string, std::vector<uint8_t>> files;
    return files;
  }
  static PackedByteArray get_file_as_bytes(const String& path) {
    Last() = Files().count(path.text()) != 0 ? OK : ERR_FILE_NOT_FOUND;
    PackedByteArray bytes;
    for (const uint8_t byte : Last() == OK ? Files()[path.text()] : std::vector<uint8_t>()) bytes.push_back(byte);
    return bytes;
  }
  static Error get_open_error() { return Last(); }
  static Error& Last() {
    static Error error = OK;
    return error;
  }
};

class Mesh : public Resource {
 public:
  enum ArrayType {
    ARRAY_VERTEX,
    ARRAY_NORMAL,
    ARRAY_TANGENT,
    ARRAY_TEX_UV = 4,
    ARRAY_BONES = 10,
    ARRAY_WEIGHTS,
    ARRAY_INDEX,
    ARRAY_MAX
  };
  enum PrimitiveType { PRIMITIVE_TRIANGLES = 3 };
  enum ArrayFormat { ARRAY_FLAG_USE_DYNAMIC_UPDATE = 1 << 26 };
  int32_t get_surface_count() const { return static_cast<int32_t>(surfaces.size()); }
  Array surface_get_arrays(int32_t surface) const { return surfaces.at(static_cast<size_t>(surface)); }
  std::vector<Array> surfaces;
};
class ArrayMesh : public Mesh {
 public:
  void add_surface_from_arrays(PrimitiveType, const Array& arrays, const TypedArray<Array>&, const Dictionary&,
                               ArrayFormat flags) {
    surfaces.push_back(arrays);
    dynamic = flags == ARRAY_FLAG_USE_DYNAMIC_UPDATE;
  }
  ArrayFormat surface_get_format(int32_t) const { return ARRAY_FLAG_USE_DYNAMIC_UPDATE; }
  void surface_update_vertex_region(int32_t, int32_t offset, const PackedByteArray& data) {
    if (offset == 0) bytes = data;
    ++updates;
  }
  bool dynamic = false;
  PackedByteArray bytes;
  int updates = 0;
};
template <typename T>
class BitField {
 public:
  BitField(int64_t value) : value_(value) {}  // NOLINT
  int64_t value() const { return value_; }

 private:
  int64_t value_;
};
// Since Godot 4.2: all positions, three floats each, then for each vertex the normal as two numbers of 16 bits.
class RenderingServer {
 public:
  enum ArrayFormat {};
  static RenderingServer* get_singleton() {
    static RenderingServer server;
    return &server;
  }
  uint32_t mesh_surface_get_format_vertex_stride(BitField<ArrayFormat>, int32_t) { return 12; }
  uint32_t mesh_surface_get_format_normal_tangent_stride(BitField<ArrayFormat>, int32_t) { return 4; }
  uint32_t mesh_surface_get_format_offset(BitField<ArrayFormat>, int32_t count, int32_t array) {
    return array == Mesh::ARRAY_NORMAL ? 12 * static_cast<uint32_t>(count) : 0;
  }
};

class Skin : public Resource {
 public:
  struct Bind {
    int32_t bone = -1;
    StringName name;
    Transform3D pose;
  };
  int32_t get_bind_count() const { return static_cast<int32_t>(binds.size()); }
  int32_t get_bind_bone(int32_t bind) const { return binds.at(static_cast<size_t>(bind)).bone; }
  StringName get_bind_name(int32_t bind) const { return binds.at(static_cast<size_t>(bind)).name; }
  Transform3D get_bind_pose(int32_t bind) const { return binds.at(static_cast<size_t>(bind)).pose; }
  std::vector<Bind> binds;
};

class Node : public Object {
 public:
  enum { NOTIFICATION_EXIT_TREE = 11, NOTIFICATION_READY = 13, NOTIFICATION_INTERNAL_PROCESS = 25 };
  Node* get_parent() const { return parent; }
  int32_t get_child_count() const { return static_cast<int32_t>(children.size()); }
  Node* get_child(int32_t i) const { return children.at(static_cast<size_t>(i)); }
  Node* get_node_or_null(const NodePath& path) const {
    return named.count(path.text()) != 0 ? named.at(path.text()) : nullptr;
  }
  StringName get_name() const { return "garment"; }
  bool is_inside_tree() const { return parent != nullptr; }
  void set_process_internal(bool on) { processes = on; }
  void set_process_priority(int32_t value) { priority = value; }
  double get_process_delta_time() const { return delta; }

  Node* parent = nullptr;
  std::vector<Node*> children;
  std::map<std::string, Node*> named;
  bool processes = false;
  int32_t priority = 0;
  double delta = 1 / 30.0;
};
class Node3D : public Node {
 public:
  Transform3D get_global_transform() const { return global; }
  void set_global_transform(const Transform3D& to) { global = to; }
  void set_as_top_level(bool on) { top_level = on; }
  bool is_visible_in_tree() const { return visible; }
  Transform3D global;
  bool top_level = false, visible = true;
};
class Skeleton3D : public Node3D {
 public:
  int32_t get_bone_count() const { return static_cast<int32_t>(names.size()); }
  String get_bone_name(int32_t bone) const { return names.at(static_cast<size_t>(bone)).c_str(); }
  int32_t find_bone(const String& name) const {
    for (size_t b = 0; b < names.size(); ++b) {
      if (names[b] == name.text()) return static_cast<int32_t>(b);
    }
    return -1;
  }
  Transform3D get_bone_global_rest(int32_t bone) const { return rest.at(static_cast<size_t>(bone)); }
  Transform3D get_bone_global_pose(int32_t bone) const { return pose.at(static_cast<size_t>(bone)); }
  std::vector<std::string> names;
  std::vector<Transform3D> rest, pose;
};
class MeshInstance3D : public Node3D {
 public:
  Ref<Mesh> get_mesh() const { return shown_mesh; }
  void set_mesh(const Ref<Mesh>& to) { shown_mesh = to; }
  Ref<Skin> get_skin() const { return bound_skin; }
  void set_skeleton_path(const NodePath& path) { skeleton_path = path; }
  void set_custom_aabb(const AABB& box) { bounds = box; }
  Ref<Mesh> shown_mesh;
  Ref<Skin> bound_skin;
  NodePath skeleton_path = "..";
  AABB bounds;
};

}  // namespace godot

#endif  // DCLOTH_TESTS_GODOT_STAND_IN_GODOT_H_
