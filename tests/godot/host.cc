// Loads the compiled extension as Godot does, through the C interface: resolves its entry, initializes it, takes down
// what it registers, makes a garment, calls its methods and its notification, plays it on a skeleton, and unloads it.
// Of Godot's own types it has what that needs: texts, arrays, callables, and objects whose methods answer for one
// scene. Whatever else the extension calls ends the program with its name. Vertices are compared with a host of
// dcloth.h. Arguments: LIBRARY ENTRY MODEL.
#include <dlfcn.h>
#include <gdextension_interface.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "dcloth/dcloth_fit.h"

namespace {

int faults = 0;

void Expect(bool good, const std::string& what) {
  if (good) return;
  ++faults;
  std::fprintf(stderr, "host: %s\n", what.c_str());
}

// Strings and names: eight bytes, the address of a text that stays; null for the empty one.
const std::string* Intern(const std::string& text) {
  static std::set<std::string> texts;
  return text.empty() ? nullptr : &*texts.insert(text).first;
}
std::string TextOf(const void* name) {
  const std::string* text = nullptr;
  std::memcpy(&text, name, sizeof(text));
  return text == nullptr ? "" : *text;
}
void PutText(void* to, const char* text) {
  const std::string* const interned = Intern(text);
  std::memcpy(to, &interned, sizeof(interned));
}

struct Object {
  std::string type;
  std::string extension_type;
  void* instance = nullptr;  // the extension's
  void* binding = nullptr;
  const GDExtensionInstanceBindingCallbacks* callbacks = nullptr;
  int references = 0;
};
std::set<Object*> alive;

struct Method {
  GDExtensionClassMethodPtrCall call;
  void* userdata;
  uint32_t arguments;
};
struct Class {
  std::string parent;
  GDExtensionClassCreationInfo3 info;
  std::map<std::string, Method> methods;
  std::map<std::string, std::pair<std::string, std::string>> properties;  // setter, getter
  std::set<std::string> constants;
};
std::map<std::string, Class> classes;
std::set<std::string> unregistered;
std::vector<std::string> calls;  // of the engine's own methods

// A function for each name of the interface that nothing below gives a meaning to.
constexpr size_t kStubs = 1024;
std::array<std::string, kStubs> stub_names;
template <size_t kIndex>
void Stub() {
  std::fprintf(stderr, "host: the extension called %s, which this host lacks\n", stub_names[kIndex].c_str());
  std::exit(1);
}
template <size_t... kIndex>
constexpr std::array<void (*)(), kStubs> MakeStubs(std::index_sequence<kIndex...>) {
  return {Stub<kIndex>...};
}
GDExtensionInterfaceFunctionPtr StubFor(const std::string& name) {
  static constexpr auto kAll = MakeStubs(std::make_index_sequence<kStubs>());
  static size_t used = 0;
  for (size_t i = 0; i < used; ++i) {
    if (stub_names[i] == name) return kAll[i];
  }
  if (used == kStubs) return nullptr;
  stub_names[used] = name;
  return kAll[used++];
}

bool IsWide(GDExtensionVariantType type) {  // sixteen bytes; the other types that a registration makes have eight
  return type == GDEXTENSION_VARIANT_TYPE_CALLABLE || type == GDEXTENSION_VARIANT_TYPE_SIGNAL ||
         type >= GDEXTENSION_VARIANT_TYPE_PACKED_BYTE_ARRAY;
}
template <size_t kBytes>
void Clear(GDExtensionUninitializedTypePtr to, const GDExtensionConstTypePtr*) {
  std::memset(to, 0, kBytes);
}
template <size_t kBytes>
void Copy(GDExtensionUninitializedTypePtr to, const GDExtensionConstTypePtr* from) {
  std::memcpy(to, from[0], kBytes);
}
GDExtensionPtrConstructor ConstructorOf(GDExtensionVariantType type, int32_t index) {
  if (IsWide(type)) return index == 0 ? Clear<16> : Copy<16>;
  return index == 0 ? Clear<8> : Copy<8>;
}
GDExtensionPtrDestructor DestructorOf(GDExtensionVariantType) {
  return [](GDExtensionTypePtr) {};
}
GDExtensionPtrOperatorEvaluator OperatorOf(GDExtensionVariantOperator operation, GDExtensionVariantType,
                                           GDExtensionVariantType) {
  if (operation == GDEXTENSION_VARIANT_OP_EQUAL) {
    return [](GDExtensionConstTypePtr a, GDExtensionConstTypePtr b, GDExtensionTypePtr to) {
      *static_cast<bool*>(to) = std::memcmp(a, b, 8) == 0;
    };
  }
  if (operation == GDEXTENSION_VARIANT_OP_NOT_EQUAL) {
    return [](GDExtensionConstTypePtr a, GDExtensionConstTypePtr b, GDExtensionTypePtr to) {
      *static_cast<bool*>(to) = std::memcmp(a, b, 8) != 0;
    };
  }
  return reinterpret_cast<GDExtensionPtrOperatorEvaluator>(StubFor("an operator"));
}
// Arrays: the address of what they hold, which stays; null while they are empty.
using Texts = std::vector<std::string>;
using Bytes = std::vector<uint8_t>;
using Variant = std::array<uint8_t, 24>;
template <typename T>
T*& Held(const void* array) {
  return *static_cast<T**>(const_cast<void*>(array));
}
template <typename T>
T& Made(const void* array) {
  if (Held<T>(array) == nullptr) Held<T>(array) = new T;
  return *Held<T>(array);
}

// Methods of built-in types, as (self, arguments, result, count).
using BuiltIn = void(GDExtensionTypePtr, const GDExtensionConstTypePtr*, GDExtensionTypePtr, int);
BuiltIn* TextMethod(const std::string& name) {
  if (name == "hash") {
    return [](auto self, auto, auto to, int) { std::memcpy(to, self, 8); };
  }
  if (name == "split") {
    return [](auto self, auto arguments, auto to, int) {
      const std::string text = TextOf(self), at = TextOf(arguments[0]);
      size_t begin = 0;
      Held<Texts>(to) = new Texts;
      for (size_t end = 0; (end = text.find(at, begin)) != std::string::npos; begin = end + at.size()) {
        Held<Texts>(to)->push_back(text.substr(begin, end - begin));
      }
      Held<Texts>(to)->push_back(text.substr(begin));
    };
  }
  if (name == "join") {
    return [](auto self, auto arguments, auto to, int) {
      std::string joined;
      for (const std::string& part : Made<Texts>(arguments[0])) joined += (joined.empty() ? "" : TextOf(self)) + part;
      PutText(to, joined.c_str());
    };
  }
  return nullptr;
}
template <size_t kItem>
BuiltIn* PackedMethod(const std::string& name) {
  if (name == "size") {
    return [](auto self, auto, auto to, int) {
      *static_cast<int64_t*>(to) = static_cast<int64_t>(Made<Bytes>(self).size() / kItem);
    };
  }
  if (name == "resize") {
    return [](auto self, auto arguments, auto to, int) {
      Made<Bytes>(self).resize(kItem * static_cast<size_t>(*static_cast<const int64_t*>(arguments[0])));
      *static_cast<int64_t*>(to) = 0;
    };
  }
  if (name == "fill") {
    return [](auto self, auto arguments, auto, int) {
      Bytes& bytes = Made<Bytes>(self);
      // A byte is handed over as the integer that it is.
      for (size_t at = 0; at < bytes.size(); at += kItem) std::memcpy(&bytes[at], arguments[0], kItem);
    };
  }
  return nullptr;
}
BuiltIn* ArrayMethod(const std::string& name) {
  if (name == "set_typed") {
    return [](auto, auto, auto, int) {};
  }
  if (name == "resize") {
    return [](auto self, auto arguments, auto to, int) {
      Made<std::vector<Variant>>(self).resize(static_cast<size_t>(*static_cast<const int64_t*>(arguments[0])));
      *static_cast<int64_t*>(to) = 0;
    };
  }
  return nullptr;
}

struct Call {
  GDExtensionCallableCustomInfo2* callable;
  std::vector<Variant> arguments;
};
std::vector<Call> deferred;
void Run(const Call& call) {
  std::vector<const void*> arguments;
  for (const Variant& argument : call.arguments) arguments.push_back(argument.data());
  Variant result = {};
  GDExtensionCallError error = {};
  call.callable->call_func(call.callable->callable_userdata, arguments.data(),
                           static_cast<GDExtensionInt>(arguments.size()), result.data(), &error);
  Expect(error.error == GDEXTENSION_CALL_OK, "a callable refused its call");
}
BuiltIn* CallableMethod(const std::string& name) {
  if (name != "call_deferred") return nullptr;
  return [](auto self, auto arguments, auto, int count) {
    Call call = {Held<GDExtensionCallableCustomInfo2>(self), {}};
    for (int i = 0; i < count; ++i) {
      call.arguments.emplace_back();
      std::memcpy(call.arguments.back().data(), arguments[i], sizeof(Variant));
    }
    deferred.push_back(call);
  };
}
GDExtensionPtrBuiltInMethod BuiltInOf(GDExtensionVariantType type, GDExtensionConstStringNamePtr name, GDExtensionInt) {
  const std::string text = TextOf(name);
  BuiltIn* method = nullptr;
  switch (type) {
    case GDEXTENSION_VARIANT_TYPE_STRING:
    case GDEXTENSION_VARIANT_TYPE_STRING_NAME:
      method = TextMethod(text);
      break;
    case GDEXTENSION_VARIANT_TYPE_NODE_PATH:
      if (text == "is_empty") {
        method = [](auto self, auto, auto to, int) { *static_cast<bool*>(to) = TextOf(self).empty(); };
      }
      break;
    case GDEXTENSION_VARIANT_TYPE_ARRAY:
      method = ArrayMethod(text);
      break;
    case GDEXTENSION_VARIANT_TYPE_CALLABLE:
      method = CallableMethod(text);
      break;
    case GDEXTENSION_VARIANT_TYPE_PACKED_BYTE_ARRAY:
      method = PackedMethod<1>(text);
      break;
    case GDEXTENSION_VARIANT_TYPE_PACKED_INT32_ARRAY:
      method = PackedMethod<4>(text);
      break;
    case GDEXTENSION_VARIANT_TYPE_PACKED_VECTOR3_ARRAY:
      method = PackedMethod<12>(text);
      break;
    case GDEXTENSION_VARIANT_TYPE_PACKED_STRING_ARRAY:
      if (text == "size") {
        method = [](auto self, auto, auto to, int) {
          *static_cast<int64_t*>(to) = static_cast<int64_t>(Made<Texts>(self).size());
        };
      }
      break;
    default:
      break;
  }
  if (method != nullptr) return method;
  return reinterpret_cast<GDExtensionPtrBuiltInMethod>(StubFor("the built-in method " + text));
}

// The scene: a skeleton at `placed`, a garment below it, and what the garment hands to the rendering server.
struct Affine {
  double m[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
  Affine operator*(const Affine& b) const {
    Affine product;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 4; ++c) {
        product.m[r][c] = m[r][0] * b.m[0][c] + m[r][1] * b.m[1][c] + m[r][2] * b.m[2][c] + (c == 3 ? m[r][3] : 0);
      }
    }
    return product;
  }
};
struct Scene {
  Object skeleton{"Skeleton3D", {}, nullptr, nullptr, nullptr, 1};
  Affine placed;
  std::vector<std::string> names;
  std::vector<Affine> rest, pose;
  Object* mesh = nullptr;
  GDExtensionCallableCustomInfo2* updated = nullptr;
  Bytes vertices;
  float garment[12] = {};
  size_t corners = 0;
} scene;

// Basis by rows, then the origin.
void PutTransform(const Affine& a, void* to) {
  float values[12];
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) values[3 * r + c] = static_cast<float>(a.m[r][c]);
    values[9 + r] = static_cast<float>(a.m[r][3]);
  }
  std::memcpy(to, values, sizeof(values));
}

// True if the scene answers.
bool Answer(const std::string& name, const GDExtensionConstTypePtr* arguments, GDExtensionTypePtr to) {
  const auto integer = [&](int i) { return *static_cast<const int64_t*>(arguments[i]); };
  const auto bone = [&] { return static_cast<size_t>(integer(0)); };
  if (name == "get_parent") return *static_cast<void**>(to) = &scene.skeleton, true;
  if (name == "get_bone_count") return *static_cast<int64_t*>(to) = static_cast<int64_t>(scene.names.size()), true;
  if (name == "get_bone_name") return PutText(to, scene.names.at(bone()).c_str()), true;
  if (name == "get_bone_global_rest") return PutTransform(scene.rest.at(bone()), to), true;
  if (name == "get_bone_global_pose") return PutTransform(scene.pose.at(bone()), to), true;
  if (name == "get_global_transform") return PutTransform(scene.placed, to), true;
  if (name == "set_global_transform") return std::memcpy(scene.garment, arguments[0], sizeof(scene.garment)), true;
  if (name == "get_instance_id") return *static_cast<uint64_t*>(to) = 1, true;  // only the skeleton is asked
  if (name == "get_process_delta_time") return *static_cast<double*>(to) = 1 / 30.0, true;
  if (name == "is_visible_in_tree" || name == "is_connected") return *static_cast<int8_t*>(to) = 1, true;
  if (name == "connect") {
    Expect(TextOf(arguments[0]) == "skeleton_updated", "another signal");
    return scene.updated = Held<GDExtensionCallableCustomInfo2>(arguments[1]), true;
  }
  if (name == "disconnect") return scene.updated = nullptr, true;
  if (name == "add_surface_from_arrays") {
    constexpr size_t kIndex = 12;
    const Variant& index = Made<std::vector<Variant>>(arguments[1]).at(kIndex);
    return scene.corners = Made<Bytes>(&index[8]).size() / 4, true;
  }
  if (name == "mesh_surface_get_format_vertex_stride") return *static_cast<int64_t*>(to) = 12, true;
  if (name == "mesh_surface_get_format_normal_tangent_stride") return *static_cast<int64_t*>(to) = 4, true;
  if (name == "mesh_surface_get_format_offset") return *static_cast<int64_t*>(to) = 12 * integer(1), true;
  if (name == "set_mesh") {
    scene.mesh = arguments[0] == nullptr ? nullptr : *static_cast<Object* const*>(arguments[0]);
    if (scene.mesh != nullptr) scene.mesh->references += 1;
    return true;
  }
  if (name == "get_mesh") {
    if (scene.mesh != nullptr) scene.mesh->references += 1;
    return *static_cast<void**>(to) = scene.mesh, true;
  }
  if (name == "surface_update_vertex_region") return scene.vertices = Made<Bytes>(arguments[2]), true;
  return false;
}

// The engine's methods, by name. References are counted; the rest is written down and gives zeros.
void CallMethod(GDExtensionMethodBindPtr bind, GDExtensionObjectPtr object, const GDExtensionConstTypePtr* arguments,
                GDExtensionTypePtr to) {
  const std::string& name = *static_cast<const std::string*>(bind);
  auto* const self = static_cast<Object*>(object);
  if (name == "init_ref" || name == "reference") {
    self->references += 1;
    *static_cast<int8_t*>(to) = 1;
  } else if (name == "unreference") {
    *static_cast<int8_t*>(to) = --self->references == 0;
  } else if (!Answer(name, arguments, to)) {
    calls.push_back(name);
    if (to != nullptr) std::memset(to, 0, 8);
  }
}

void Destroy(void* object) {
  auto* const self = static_cast<Object*>(object);
  if (alive.erase(self) == 0) return Expect(false, "an object is destroyed twice");
  if (self->instance != nullptr) {
    const GDExtensionClassCreationInfo3& info = classes[self->extension_type].info;
    info.free_instance_func(info.class_userdata, self->instance);
  } else if (self->binding != nullptr) {
    self->callbacks->free_callback(nullptr, object, self->binding);
  }
  delete self;
}

template <typename F>
GDExtensionInterfaceFunctionPtr As(F* function) {
  return reinterpret_cast<GDExtensionInterfaceFunctionPtr>(function);
}

GDExtensionInterfaceFunctionPtr GetProcAddress(const char* symbol) {
  static const std::map<std::string, GDExtensionInterfaceFunctionPtr> known = {
      {"get_godot_version", As(+[](GDExtensionGodotVersion* v) {
         *v = {4, 3, 0, "4.3"};
       })},
      {"mem_alloc", As(+[](size_t bytes) { return std::malloc(bytes); })},
      {"mem_realloc", As(+[](void* old, size_t bytes) { return std::realloc(old, bytes); })},
      {"mem_free", As(+[](void* old) { std::free(old); })},
      {"print_error", As(+[](const char* text, const char*, const char*, int32_t, GDExtensionBool) {
         Expect(false, std::string("the extension printed: ") + text);
       })},
      {"print_error_with_message",
       As(+[](const char*, const char* text, const char*, const char*, int32_t, GDExtensionBool) {
         Expect(false, std::string("the extension printed: ") + text);
       })},
      {"string_name_new_with_latin1_chars",
       As(+[](void* to, const char* text, GDExtensionBool) { PutText(to, text); })},
      {"string_name_new_with_utf8_chars", As(+[](void* to, const char* text) { PutText(to, text); })},
      {"string_new_with_latin1_chars", As(+[](void* to, const char* text) { PutText(to, text); })},
      {"string_new_with_utf32_chars", As(+[](void* to, const char32_t* text) {
         std::string narrow;
         for (; *text != 0; ++text) narrow.push_back(static_cast<char>(*text));
         PutText(to, narrow.c_str());
       })},
      {"string_new_with_utf8_chars", As(+[](void* to, const char* text) { PutText(to, text); })},
      {"string_new_with_utf8_chars_and_len2",
       As(+[](void* to, const char* text, GDExtensionInt size) -> GDExtensionInt {
         PutText(to, size < 0 ? text : std::string(text, static_cast<size_t>(size)).c_str());
         return 0;
       })},
      {"variant_get_ptr_constructor", As(ConstructorOf)},
      {"variant_get_ptr_destructor", As(DestructorOf)},
      {"variant_get_ptr_operator_evaluator", As(OperatorOf)},
      {"variant_get_ptr_builtin_method", As(BuiltInOf)},
      {"variant_new_nil", As(+[](void* to) { std::memset(to, 0, 24); })},
      {"variant_destroy", As(+[](void*) {})},
      {"variant_new_copy", As(+[](void* to, const void* from) { std::memcpy(to, from, sizeof(Variant)); })},
      {"variant_get_type", As(+[](const void*) { return GDEXTENSION_VARIANT_TYPE_FLOAT; })},
      {"variant_can_convert_strict", As(+[](int, int) -> GDExtensionBool { return 1; })},
      {"get_variant_from_type_constructor", As(+[](int) {
         return +[](void* variant, void* value) {
           std::memset(variant, 0, sizeof(Variant));
           std::memcpy(static_cast<uint8_t*>(variant) + 8, value, 8);
         };
       })},
      {"get_variant_to_type_constructor", As(+[](int) {
         return +[](void* value, void* variant) { std::memcpy(value, static_cast<uint8_t*>(variant) + 8, 8); };
       })},
      {"array_set_typed", As(+[](void*, int, const void*, const void*) {})},
      {"array_operator_index", As(+[](void* array, int64_t i) -> void* {
         return Made<std::vector<Variant>>(array).at(static_cast<size_t>(i)).data();
       })},
      {"packed_byte_array_operator_index", As(+[](void* array, int64_t i) { return Made<Bytes>(array).data() + i; })},
      {"packed_byte_array_operator_index_const",
       As(+[](const void* array, int64_t i) { return Made<Bytes>(array).data() + i; })},
      {"packed_int32_array_operator_index",
       As(+[](void* array, int64_t i) { return Made<Bytes>(array).data() + 4 * i; })},
      {"callable_custom_create2", As(+[](void* to, const GDExtensionCallableCustomInfo2* info) {
         std::memset(to, 0, 16);
         Held<GDExtensionCallableCustomInfo2>(to) = new GDExtensionCallableCustomInfo2(*info);
       })},
      {"string_to_utf8_chars", As(+[](const void* text, char* to, int64_t most) {
         const std::string found = TextOf(text);
         if (to != nullptr) std::memcpy(to, found.data(), std::min(found.size(), static_cast<size_t>(most)));
         return static_cast<int64_t>(found.size());
       })},
      {"ref_get_object", As(+[](const void* ref) { return *static_cast<void* const*>(ref); })},
      {"object_get_instance_from_id", As(+[](uint64_t) -> void* { return &scene.skeleton; })},
      {"object_get_class_name", As(+[](const void* object, void*, void* to) -> GDExtensionBool {
         PutText(to, static_cast<const Object*>(object)->type.c_str());
         return 1;
       })},
      {"global_get_singleton", As(+[](const void* name) -> void* {
         static std::map<std::string, Object> singletons;
         Object& one = singletons[TextOf(name)];
         one.type = TextOf(name);
         return &one;
       })},
      {"classdb_construct_object", As(+[](const void* name) -> void* {
         auto* const made = new Object{TextOf(name), {}, nullptr, nullptr, nullptr, 0};
         alive.insert(made);
         return made;
       })},
      {"object_set_instance", As(+[](void* object, const void* name, void* instance) {
         static_cast<Object*>(object)->extension_type = TextOf(name);
         static_cast<Object*>(object)->instance = instance;
       })},
      {"object_set_instance_binding",
       As(+[](void* object, void*, void* binding, const GDExtensionInstanceBindingCallbacks* callbacks) {
         static_cast<Object*>(object)->binding = binding;
         static_cast<Object*>(object)->callbacks = callbacks;
       })},
      {"object_get_instance_binding",
       As(+[](void* object, void* token, const GDExtensionInstanceBindingCallbacks* callbacks) {
         auto* const self = static_cast<Object*>(object);
         if (self->binding == nullptr && callbacks != nullptr) {
           self->binding = callbacks->create_callback(token, object);
           self->callbacks = callbacks;
         }
         return self->binding;
       })},
      {"object_free_instance_binding",
       As(+[](void* object, void*) { static_cast<Object*>(object)->binding = nullptr; })},
      {"object_destroy", As(Destroy)},
      {"classdb_get_method_bind", As(+[](const void*, const void* name, GDExtensionInt) {
         return static_cast<const void*>(Intern(TextOf(name)));
       })},
      {"object_method_bind_ptrcall", As(CallMethod)},
      {"classdb_register_extension_class3",
       As(+[](void*, const void* name, const void* parent, const GDExtensionClassCreationInfo3* info) {
         classes[TextOf(name)] = {TextOf(parent), *info, {}, {}, {}};
       })},
      {"classdb_register_extension_class_method",
       As(+[](void*, const void* name, const GDExtensionClassMethodInfo* info) {
         classes[TextOf(name)].methods[TextOf(info->name)] = {info->ptrcall_func, info->method_userdata,
                                                              info->argument_count};
       })},
      {"classdb_register_extension_class_property_indexed",
       As(+[](void*, const void* name, const GDExtensionPropertyInfo* info, const void* setter, const void* getter,
              GDExtensionInt) {
         classes[TextOf(name)].properties[TextOf(info->name)] = {TextOf(setter), TextOf(getter)};
       })},
      {"classdb_register_extension_class_integer_constant",
       As(+[](void*, const void* name, const void*, const void* constant, GDExtensionInt, GDExtensionBool) {
         classes[TextOf(name)].constants.insert(TextOf(constant));
       })},
      {"classdb_unregister_extension_class", As(+[](void*, const void* name) { unregistered.insert(TextOf(name)); })},
  };
  // What hands out functions hands out stubs.
  static const std::set<std::string> givers = {
      "variant_get_ptr_utility_function", "variant_get_ptr_setter",         "variant_get_ptr_getter",
      "variant_get_ptr_indexed_setter",   "variant_get_ptr_indexed_getter", "variant_get_ptr_keyed_setter",
      "variant_get_ptr_keyed_getter",     "variant_get_ptr_keyed_checker",  "get_variant_from_type_constructor",
      "get_variant_to_type_constructor",  "variant_get_ptr_internal_getter"};
  const auto found = known.find(symbol);
  if (found != known.end()) return found->second;
  if (givers.count(symbol) == 0) return StubFor(symbol);
  return As(+[](const void*, const void*, int64_t) { return StubFor("a function of a built-in type"); });
}

// A property of the garment that keeps what it is given.
template <typename T, size_t kCount>
void RoundTrip(const Class& type, void* instance, const std::string& property, const std::array<T, kCount>& value) {
  const auto accessors = type.properties.find(property);
  if (accessors == type.properties.end()) return Expect(false, "no property " + property);
  const auto setter = type.methods.find(accessors->second.first), getter = type.methods.find(accessors->second.second);
  if (setter == type.methods.end() || getter == type.methods.end()) return Expect(false, property + " lacks a method");
  const GDExtensionConstTypePtr arguments[] = {value.data()};
  std::array<T, kCount> found = {};
  setter->second.call(setter->second.userdata, instance, arguments, nullptr);
  getter->second.call(getter->second.userdata, instance, nullptr, found.data());
  Expect(found == value, property + " does not keep its value");
}

void TryGarment() {
  const Class& type = classes["DClothGarment"];
  Expect(type.parent == "MeshInstance3D", "DClothGarment is a " + type.parent);
  Expect(type.properties.size() == 10 && type.constants.size() == 6, "properties or constants of DClothGarment");
  for (const auto& [name, accessors] : type.properties) {
    Expect(type.methods.count(accessors.first) == 1 && type.methods.at(accessors.first).arguments == 1,
           "setter of " + name);
    Expect(type.methods.count(accessors.second) == 1 && type.methods.at(accessors.second).arguments == 0,
           "getter of " + name);
  }
  calls.clear();
  auto* const object = static_cast<Object*>(type.info.create_instance_func(type.info.class_userdata));
  const auto called = [](const char* name) {
    for (const std::string& call : calls) {
      if (call == name) return true;
    }
    return false;
  };
  Expect(object != nullptr && object->instance != nullptr, "DClothGarment cannot be made");
  Expect(called("set_as_top_level") && called("set_process_priority"), "DClothGarment is not prepared");
  RoundTrip<float, 3>(type, object->instance, "wind", {1, -2, 3.5f});
  RoundTrip<int64_t, 1>(type, object->instance, "detail", {1});
  RoundTrip<int64_t, 1>(type, object->instance, "fit", {2});
  RoundTrip<int8_t, 1>(type, object->instance, "pipelined", {1});
  RoundTrip<int8_t, 1>(type, object->instance, "outside_body", {0});
  constexpr int32_t kReady = 13;
  type.info.notification_func(object->instance, kReady, 0);
  Expect(called("is_editor_hint") && called("set_process_internal"), "DClothGarment does not start");
  Destroy(object);
}

// What a host of dcloth.h draws of the same poses.
class Reference {
 public:
  explicit Reference(const Bytes& file) : bytes_(Aligned(file.size())), view_(Aligned(dcloth_model_storage_size())) {
    std::memcpy(bytes_, file.data(), file.size());
    Expect(dcloth_model_open(bytes_, file.size(), view_, dcloth_model_storage_size(), &model, nullptr) == DCLOTH_OK,
           "the model does not open");
    info.struct_size = sizeof(info);
    dcloth_model_describe(model, &info);
    positions.resize(3 * info.vertex_count);
    const size_t size = dcloth_cloth_storage_size(model);
    dcloth_cloth_create(model, Aligned(size), size, &cloth_, nullptr);
  }
  void Fit(const std::vector<std::string>& names, const std::vector<Affine>& binds) {
    std::vector<const char*> pointers;
    for (const std::string& name : names) pointers.push_back(name.c_str());
    const std::vector<float> matrices = Rows(binds);
    dcloth_character character = {};
    character.struct_size = sizeof(character);
    character.joint_count = static_cast<uint32_t>(names.size());
    character.joint_names = pointers.data();
    character.bind_matrices = matrices.data();
    Expect(dcloth_cloth_fit(cloth_, &character, nullptr, 0, nullptr, nullptr) == DCLOTH_OK, "the figure does not fit");
  }
  void Frame(const std::vector<Affine>& pose) {
    const std::vector<float> matrices = Rows(pose);
    const dcloth_pose posed = {sizeof(posed), static_cast<uint32_t>(pose.size()), matrices.data(), 0, 0};
    const dcloth_frame frame = {sizeof(frame), DCLOTH_STAGES_MESH, 1 / 30.0f, 0, nullptr};
    dcloth_output output = {};
    output.struct_size = sizeof(output);
    output.vertex_count = info.vertex_count;
    output.positions = positions.data();
    output.position_stride_bytes = 12;
    Expect(dcloth_cloth_update(cloth_, &posed, &frame, &output, nullptr) == DCLOTH_OK, "a frame was refused");
  }

  dcloth_model* model = nullptr;
  dcloth_model_info info = {};
  std::vector<float> positions;

 private:
  static void* Aligned(size_t size) {
    return std::aligned_alloc(DCLOTH_ALIGNMENT, (size + DCLOTH_ALIGNMENT - 1) / DCLOTH_ALIGNMENT * DCLOTH_ALIGNMENT);
  }
  static std::vector<float> Rows(const std::vector<Affine>& affines) {
    std::vector<float> rows;
    for (const Affine& a : affines) {
      for (const auto& row : a.m) {
        for (const double value : row) rows.push_back(static_cast<float>(value));
      }
      rows.insert(rows.end(), {0, 0, 0, 1});
    }
    return rows;
  }
  void* bytes_;
  void* view_;
  dcloth_cloth* cloth_ = nullptr;
};

Affine Turned(int axis, double angle, double x = 0, double y = 0, double z = 0) {
  Affine a;
  const int next = (axis + 1) % 3, last = (axis + 2) % 3;
  a.m[next][next] = a.m[last][last] = std::cos(angle);
  a.m[last][next] = std::sin(angle);
  a.m[next][last] = -std::sin(angle);
  a.m[0][3] = x, a.m[1][3] = y, a.m[2][3] = z;
  return a;
}

// A garment on the figure of training, which walks in a curve and shakes every joint.
void TryPlay(const char* path) {
  Bytes file;
  std::FILE* const from = std::fopen(path, "rb");
  if (from == nullptr) return Expect(false, std::string("cannot read ") + path);
  for (int c = 0; (c = std::fgetc(from)) != EOF;) file.push_back(static_cast<uint8_t>(c));
  std::fclose(from);
  Reference reference(file);
  scene.placed = Turned(1, M_PI / 2, 4, 0, -2);
  const Affine upright = Turned(1, M_PI / 2);
  std::vector<Affine> binds;
  for (uint32_t j = 0; j < reference.info.joint_count; ++j) {
    float bind[16];
    dcloth_model_joint_bind(reference.model, j, bind);
    Affine a;
    for (size_t i = 0; i < 12; ++i) a.m[i / 4][i % 4] = static_cast<double>(bind[i]);
    scene.names.emplace_back(dcloth_model_joint_name(reference.model, j));
    scene.rest.push_back(a);
    binds.push_back(upright * a);
  }
  reference.Fit(scene.names, binds);

  const Class &model_type = classes["DClothModel"], &type = classes["DClothGarment"];
  auto* const model = static_cast<Object*>(model_type.info.create_instance_func(model_type.info.class_userdata));
  auto* const garment = static_cast<Object*>(type.info.create_instance_func(type.info.class_userdata));
  model->references += 1;
  const auto call = [](const Class& of, Object* object, const char* name, const void* argument, void* to) {
    const Method& method = of.methods.at(name);
    method.call(method.userdata, object->instance, &argument, to);
  };
  Bytes* bytes[2] = {&file, nullptr};  // a PackedByteArray
  void* refused = nullptr;
  call(model_type, model, "open", bytes, &refused);
  Expect(refused == nullptr, "the model was refused: " + TextOf(&refused));
  const int64_t bones = 1;
  const int8_t off = 0;
  call(type, garment, "set_model", &model, nullptr);
  call(type, garment, "set_fit", &bones, nullptr);
  call(type, garment, "set_outside_body", &off, nullptr);

  double worst = 0;
  constexpr int kFrames = 120, kExitTree = 11, kInternalProcess = 25;
  for (int f = 0; f < kFrames; ++f) {
    const double t = f / 30.0;
    std::vector<Affine> world;
    scene.pose.clear();
    for (size_t j = 0; j < scene.rest.size(); ++j) {
      const Affine walk = Turned(1, 0.8 * t, std::sin(t), 0.03 * std::sin(9 * t), 1.2 * t);
      scene.pose.push_back(walk * scene.rest[j] * Turned(0, 0.1 * std::sin(5 * t + static_cast<double>(j))));
      world.push_back(scene.placed * scene.pose.back());
    }
    type.info.notification_func(garment->instance, kInternalProcess, 0);
    int8_t dressed = 0;
    call(type, garment, "is_dressed", nullptr, &dressed);
    if (dressed == 0 || scene.updated == nullptr) return Expect(false, "the garment is not dressed");
    Run({scene.updated, {}});
    for (const Call& later : std::exchange(deferred, {})) Run(later);
    reference.Frame(world);
    const uint32_t drawn = std::max(reference.info.vertex_count, reference.info.textured_vertex_count);
    if (scene.vertices.size() != 16 * size_t{drawn}) return Expect(false, "no vertices");
    for (size_t i = 0; i < reference.positions.size(); ++i) {
      float value = 0;
      std::memcpy(&value, &scene.vertices[4 * i], 4);
      worst = std::max(worst, std::abs(static_cast<double>(value + scene.garment[9 + i % 3] - reference.positions[i])));
    }
  }
  std::printf("%d frames of %u vertices, worst %.5f mm from a host of dcloth.h\n", kFrames, reference.info.vertex_count,
              1000 * worst);
  Expect(1000 * worst < 0.01, "vertices are not those of dcloth.h");
  Expect(scene.corners == 3 * size_t{reference.info.triangle_count}, "triangles are missing");
  type.info.notification_func(garment->instance, kExitTree, 0);
  Expect(scene.updated == nullptr && scene.mesh == nullptr, "the garment does not let go of its character");
  Destroy(garment);
  Expect(model->references == 1, "the garment does not let go of its model");
  Destroy(model);
}

void TryLoader() {
  const Class& type = classes["DClothModelLoader"];
  Expect(type.parent == "ResourceFormatLoader", "DClothModelLoader is a " + type.parent);
  for (const char* name : {"_load", "_handles_type", "_get_resource_type", "_get_recognized_extensions", "_exists"}) {
    const std::string* const text = Intern(name);
    const bool has = type.info.get_virtual_func(type.info.class_userdata, &text) != nullptr;
    Expect(has == (std::strcmp(name, "_exists") != 0), std::string("the loader's ") + name);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  void* const library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) return std::fprintf(stderr, "host: %s\n", dlerror()), 1;
  const auto entry = reinterpret_cast<GDExtensionInitializationFunction>(dlsym(library, argv[2]));
  if (entry == nullptr) return std::fprintf(stderr, "host: no entry %s\n", argv[2]), 1;
  GDExtensionInitialization extension = {};
  int token = 0;
  Expect(entry(GetProcAddress, &token, &extension) != 0, "the entry refused");
  Expect(extension.minimum_initialization_level == GDEXTENSION_INITIALIZATION_SCENE, "another level than the scene's");
  if (faults != 0) return 1;
  extension.initialize(extension.userdata, GDEXTENSION_INITIALIZATION_SCENE);
  Expect(classes.size() == 3 && classes.count("DClothModel") == 1, "classes are missing");
  Expect(!calls.empty() && calls.back() == "add_resource_format_loader", "the loader is not added");
  size_t methods = 0;
  for (const auto& [name, type] : classes) methods += type.methods.size();
  TryGarment();
  TryLoader();
  TryPlay(argv[3]);
  calls.clear();
  extension.deinitialize(extension.userdata, GDEXTENSION_INITIALIZATION_SCENE);
  Expect(calls == std::vector<std::string>{"remove_resource_format_loader"}, "the loader is not removed");
  Expect(unregistered.size() == classes.size(), "classes are not taken back");
  std::printf("%zu classes, %zu methods, %zu properties registered; %d faults\n", classes.size(), methods,
              classes["DClothGarment"].properties.size(), faults);
  return faults == 0 ? 0 : 1;
}
