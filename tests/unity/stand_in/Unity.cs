// The names and signatures of Unity's runtime that the package uses, so that it compiles without Unity. Nothing here
// runs: what Unity does with them can only be seen in Unity.
using System;
using Unity.Collections;
using UnityEngine.Rendering;

namespace UnityEngine
{
    [AttributeUsage(AttributeTargets.Field)]
    public sealed class SerializeField : Attribute { }

    public class PropertyAttribute : Attribute { }

    [AttributeUsage(AttributeTargets.Field)]
    public sealed class HideInInspector : Attribute { }

    [AttributeUsage(AttributeTargets.Field)]
    public sealed class TooltipAttribute : PropertyAttribute { public TooltipAttribute(string tooltip) { } }

    [AttributeUsage(AttributeTargets.Field)]
    public sealed class RangeAttribute : PropertyAttribute { public RangeAttribute(float min, float max) { } }

    [AttributeUsage(AttributeTargets.Class)]
    public sealed class PreferBinarySerialization : Attribute { }

    [AttributeUsage(AttributeTargets.Class)]
    public sealed class AddComponentMenu : Attribute { public AddComponentMenu(string menuName) { } }

    [AttributeUsage(AttributeTargets.Class)]
    public sealed class DefaultExecutionOrder : Attribute { public DefaultExecutionOrder(int order) { } }

    [AttributeUsage(AttributeTargets.Class)]
    public sealed class DisallowMultipleComponent : Attribute { }

    public struct Vector2
    {
        public float x, y;
        public Vector2(float x, float y) => throw null;
    }

    public struct Vector3
    {
        public float x, y, z;
        public Vector3(float x, float y, float z) => throw null;
        public static Vector3 one => throw null;
        public static Vector3 operator +(Vector3 a, Vector3 b) => throw null;
        public static Vector3 operator -(Vector3 a, Vector3 b) => throw null;
        public static Vector3 operator *(float d, Vector3 a) => throw null;
        public static Vector3 Lerp(Vector3 a, Vector3 b, float t) => throw null;
    }

    public struct Vector4
    {
        public float x, y, z, w;
        public float magnitude => throw null;
        public static implicit operator Vector3(Vector4 v) => throw null;
    }

    public static class Mathf
    {
        public static int Min(int a, int b) => throw null;
        public static float Clamp01(float value) => throw null;
    }

    public struct Bounds
    {
        public Vector3 min { get; set; }
        public Vector3 max { get; set; }
        public void SetMinMax(Vector3 min, Vector3 max) => throw null;
    }

    public struct Quaternion
    {
        public static Quaternion identity => throw null;
        public static Quaternion Inverse(Quaternion rotation) => throw null;
        public static Quaternion operator *(Quaternion lhs, Quaternion rhs) => throw null;
        public static Quaternion Euler(float x, float y, float z) => throw null;
        public static Quaternion LookRotation(Vector3 forward, Vector3 upwards) => throw null;
        public static Quaternion Slerp(Quaternion a, Quaternion b, float t) => throw null;
    }

    public struct Matrix4x4
    {
        public float m00, m10, m20, m30, m01, m11, m21, m31, m02, m12, m22, m32, m03, m13, m23, m33;
        public float this[int index] { get => throw null; set => throw null; }
        public Matrix4x4 inverse => throw null;
        public Vector4 GetColumn(int index) => throw null;
        public Vector3 MultiplyPoint3x4(Vector3 point) => throw null;
        public static Matrix4x4 TRS(Vector3 pos, Quaternion q, Vector3 s) => throw null;
        public static Matrix4x4 operator *(Matrix4x4 lhs, Matrix4x4 rhs) => throw null;
    }

    [Flags]
    public enum HideFlags { None = 0, DontSave = 52, HideAndDontSave = 61 }

    public class Object
    {
        public string name { get; set; }
        public HideFlags hideFlags { get; set; }
        public static void Destroy(Object obj) => throw null;
        public static void DestroyImmediate(Object obj) => throw null;
        public static bool operator ==(Object x, Object y) => throw null;
        public static bool operator !=(Object x, Object y) => throw null;
        public override bool Equals(object other) => throw null;
        public override int GetHashCode() => throw null;
    }

    public class ScriptableObject : Object
    {
        public static T CreateInstance<T>() where T : ScriptableObject => throw null;
    }

    public class Component : Object
    {
        public GameObject gameObject => throw null;
        public Transform transform => throw null;
        public T GetComponent<T>() => throw null;
        public T[] GetComponentsInChildren<T>(bool includeInactive) => throw null;
    }

    public class Behaviour : Component
    {
        public bool enabled { get; set; }
    }

    public class MonoBehaviour : Behaviour { }

    public sealed class GameObject : Object
    {
        public GameObject(string name) => throw null;
        public Transform transform => throw null;
        public int layer { get; set; }
        public bool activeSelf => throw null;
        public SceneManagement.Scene scene => throw null;
        public T AddComponent<T>() where T : Component => throw null;
        public T GetComponent<T>() => throw null;
        public void SetActive(bool value) => throw null;
        public static GameObject CreatePrimitive(PrimitiveType type) => throw null;
    }

    public enum PrimitiveType { Sphere }

    public class Transform : Component
    {
        public Vector3 position { get; set; }
        public Quaternion rotation { get; set; }
        public Vector3 localPosition { get; set; }
        public Quaternion localRotation { get; set; }
        public Vector3 localScale { get; set; }
        public Transform root => throw null;
        public Matrix4x4 localToWorldMatrix => throw null;
        public Matrix4x4 worldToLocalMatrix => throw null;
        public void SetParent(Transform parent, bool worldPositionStays) => throw null;
        public void SetPositionAndRotation(Vector3 position, Quaternion rotation) => throw null;
    }

    public static class Time
    {
        public static float deltaTime => throw null;
    }

    public static class Debug
    {
        public static void LogError(object message) => throw null;
        public static void LogError(object message, Object context) => throw null;
        public static void LogWarning(object message, Object context) => throw null;
    }

    public class TextAsset : Object
    {
        public byte[] bytes => throw null;
    }

    public class Material : Object { }

    public sealed class Camera : Behaviour
    {
        public static Camera main => throw null;
    }

    public class Renderer : Component
    {
        public Material sharedMaterial { get; set; }
        public ShadowCastingMode shadowCastingMode { get; set; }
    }

    public class MeshRenderer : Renderer { }

    public class SkinnedMeshRenderer : Renderer
    {
        public Transform[] bones { get; set; }
        public Transform rootBone { get; set; }
        public Mesh sharedMesh { get; set; }
    }

    public sealed class MeshFilter : Component
    {
        public Mesh sharedMesh { get; set; }
    }

    public enum MeshTopology { Triangles = 0 }

    public struct BoneWeight
    {
        public float weight0 { get; set; }
        public float weight1 { get; set; }
        public float weight2 { get; set; }
        public float weight3 { get; set; }
        public int boneIndex0 { get; set; }
        public int boneIndex1 { get; set; }
        public int boneIndex2 { get; set; }
        public int boneIndex3 { get; set; }
    }

    public sealed class Mesh : Object
    {
        public bool isReadable => throw null;
        public Vector3[] vertices { get; set; }
        public int[] triangles { get; set; }
        public BoneWeight[] boneWeights { get; set; }
        public Matrix4x4[] bindposes { get; set; }
        public Vector2[] uv { get; set; }
        public Bounds bounds { get; set; }
        public int subMeshCount { get; set; }
        public void MarkDynamic() => throw null;
        public void SetVertexBufferParams(int vertexCount, params VertexAttributeDescriptor[] attributes) => throw null;
        public void SetVertexBufferData<T>(NativeArray<T> data, int dataStart, int meshBufferStart, int count,
                                           int stream = 0, MeshUpdateFlags flags = MeshUpdateFlags.Default)
            where T : struct => throw null;
        public void SetVertexBufferData<T>(T[] data, int dataStart, int meshBufferStart, int count, int stream = 0,
                                           MeshUpdateFlags flags = MeshUpdateFlags.Default)
            where T : struct => throw null;
        public void SetIndexBufferParams(int indexCount, IndexFormat format) => throw null;
        public void SetIndexBufferData<T>(T[] data, int dataStart, int meshBufferStart, int count,
                                          MeshUpdateFlags flags = MeshUpdateFlags.Default) where T : struct
            => throw null;
        public void SetSubMesh(int index, SubMeshDescriptor desc, MeshUpdateFlags flags = MeshUpdateFlags.Default) =>
            throw null;
    }
}

namespace UnityEngine.Rendering
{
    public enum ShadowCastingMode { Off = 0, On = 1, TwoSided = 2, ShadowsOnly = 3 }

    public enum IndexFormat { UInt16 = 0, UInt32 = 1 }

    [Flags]
    public enum MeshUpdateFlags
    {
        Default = 0,
        DontValidateIndices = 1,
        DontResetBoneBounds = 2,
        DontNotifyMeshUsers = 4,
        DontRecalculateBounds = 8
    }

    public enum VertexAttribute { Position = 0, Normal = 1, Tangent = 2, Color = 3, TexCoord0 = 4 }

    public enum VertexAttributeFormat { Float32 = 0, Float16 = 1 }

    public struct VertexAttributeDescriptor
    {
        public VertexAttributeDescriptor(VertexAttribute attribute = VertexAttribute.Position,
                                         VertexAttributeFormat format = VertexAttributeFormat.Float32,
                                         int dimension = 3, int stream = 0) => throw null;
    }

    public struct SubMeshDescriptor
    {
        public SubMeshDescriptor(int indexStart, int indexCount, MeshTopology topology = MeshTopology.Triangles) =>
            throw null;
    }
}

namespace UnityEngine.SceneManagement
{
    public struct Scene { }

    public static class SceneManager
    {
        public static void MoveGameObjectToScene(GameObject go, Scene scene) => throw null;
    }
}

namespace Unity.Jobs
{
    public interface IJob
    {
        void Execute();
    }

    public struct JobHandle
    {
        public void Complete() => throw null;
        public static void ScheduleBatchedJobs() => throw null;
    }

    public static class IJobExtensions
    {
        public static JobHandle Schedule<T>(this T jobData, JobHandle dependsOn = default(JobHandle))
            where T : struct, IJob => throw null;
    }
}

namespace Unity.Collections
{
    public enum Allocator { Invalid = 0, None = 1, Temp = 2, TempJob = 3, Persistent = 4 }

    public enum NativeArrayOptions { UninitializedMemory = 0, ClearMemory = 1 }

    public struct NativeArray<T> : IDisposable where T : struct
    {
        public NativeArray(int length, Allocator allocator,
            NativeArrayOptions options = NativeArrayOptions.ClearMemory) => throw null;
        public int Length => throw null;
        public bool IsCreated => throw null;
        public void Dispose() => throw null;
    }
}

namespace Unity.Collections.LowLevel.Unsafe
{
    public static class NativeArrayUnsafeUtility
    {
        public static unsafe void* GetUnsafePtr<T>(this NativeArray<T> nativeArray) where T : struct => throw null;
    }
}
