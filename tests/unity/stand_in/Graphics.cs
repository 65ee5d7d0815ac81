// Meshes that remember their bytes, renderers that draw nothing, native arrays; see Objects.cs.
using System;
using System.Runtime.InteropServices;
using Unity.Collections;
using Unity.Collections.LowLevel.Unsafe;
using UnityEngine.Rendering;

namespace UnityEngine
{
    public sealed class Material : Object
    {
    }

    public sealed class Camera : Behaviour
    {
        public static Camera main { get; set; }
    }

    public class Renderer : Component
    {
        public Material sharedMaterial { get; set; }
        public ShadowCastingMode shadowCastingMode { get; set; }
    }

    public sealed class MeshRenderer : Renderer
    {
    }

    public sealed class SkinnedMeshRenderer : Renderer
    {
        public Transform[] bones { get; set; } = new Transform[0];
        public Transform rootBone { get; set; }
    }

    public sealed class MeshFilter : Component
    {
        public Mesh sharedMesh { get; set; }
    }

    public enum MeshTopology { Triangles = 0 }

    /// <summary>Refuses data that does not fit the layout set, as Unity's does.</summary>
    public sealed unsafe class Mesh : Object
    {
        public readonly byte[][] Streams = new byte[4][];
        public readonly int[] Strides = new int[4];
        public ushort[] Indices;
        public int Uploads;
        private int vertices;

        public Vector2[] uv { get; set; } = new Vector2[0];
        public Bounds bounds { get; set; }
        public int subMeshCount { get; set; }
        public bool IsDynamic { get; private set; }
        public VertexAttributeDescriptor[] Layout { get; private set; }

        public void MarkDynamic()
        {
            IsDynamic = true;
        }

        public void SetVertexBufferParams(int vertexCount, params VertexAttributeDescriptor[] attributes)
        {
            vertices = vertexCount;
            Layout = attributes;
            Array.Clear(Strides, 0, Strides.Length);
            foreach (VertexAttributeDescriptor attribute in attributes)
                Strides[attribute.stream] += 4 * attribute.dimension;
            for (int s = 0; s < Streams.Length; ++s) Streams[s] = new byte[vertexCount * Strides[s]];
        }

        public void SetVertexBufferData<T>(NativeArray<T> data, int dataStart, int meshBufferStart, int count,
                                           int stream = 0, MeshUpdateFlags flags = MeshUpdateFlags.Default)
            where T : struct
        {
            Check(data.Length, dataStart, meshBufferStart, count, Marshal.SizeOf(typeof(T)), stream);
            Marshal.Copy((IntPtr)data.GetUnsafePtr(), Streams[stream], 0, Streams[stream].Length);
            ++Uploads;
        }

        public void SetVertexBufferData<T>(T[] data, int dataStart, int meshBufferStart, int count,
                                           int stream = 0, MeshUpdateFlags flags = MeshUpdateFlags.Default)
            where T : struct
        {
            Check(data.Length, dataStart, meshBufferStart, count, Marshal.SizeOf(typeof(T)), stream);
            GCHandle pinned = GCHandle.Alloc(data, GCHandleType.Pinned);
            Marshal.Copy(pinned.AddrOfPinnedObject(), Streams[stream], 0, Streams[stream].Length);
            pinned.Free();
        }

        public void SetIndexBufferParams(int indexCount, IndexFormat format)
        {
            Indices = new ushort[indexCount];
        }

        public void SetIndexBufferData<T>(T[] data, int dataStart, int meshBufferStart, int count,
                                          MeshUpdateFlags flags = MeshUpdateFlags.Default) where T : struct
        {
            Array.Copy(data, dataStart, Indices, meshBufferStart, count);
        }

        public void SetSubMesh(int index, SubMeshDescriptor desc, MeshUpdateFlags flags = MeshUpdateFlags.Default)
        {
            if (index >= subMeshCount || desc.indexStart + desc.indexCount > Indices.Length)
                throw new ArgumentException("submesh outside of the index buffer");
        }

        private void Check(int length, int dataStart, int start, int count, int size, int stream)
        {
            if (dataStart != 0 || start != 0 || count != length || count != vertices || size != Strides[stream])
                throw new ArgumentException(count + " of " + length + " elements of " + size + " bytes");
        }
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
                                         int dimension = 3, int stream = 0)
        {
            this.attribute = attribute;
            this.format = format;
            this.dimension = dimension;
            this.stream = stream;
        }

        public VertexAttribute attribute { get; set; }
        public VertexAttributeFormat format { get; set; }
        public int dimension { get; set; }
        public int stream { get; set; }
    }

    public struct SubMeshDescriptor
    {
        public SubMeshDescriptor(int indexStart, int indexCount, MeshTopology topology = MeshTopology.Triangles)
        {
            this.indexStart = indexStart;
            this.indexCount = indexCount;
            this.topology = topology;
        }

        public int indexStart { get; set; }
        public int indexCount { get; set; }
        public MeshTopology topology { get; set; }
    }
}

namespace Unity.Collections
{
    public enum Allocator { Invalid = 0, None = 1, Temp = 2, TempJob = 3, Persistent = 4 }

    public enum NativeArrayOptions { UninitializedMemory = 0, ClearMemory = 1 }

    public static class NativeLeaks
    {
        public static int Live;
    }

    public struct NativeArray<T> : IDisposable where T : struct
    {
        internal IntPtr buffer;

        public NativeArray(int length, Allocator allocator, NativeArrayOptions options = NativeArrayOptions.ClearMemory)
        {
            Length = length;
            buffer = Marshal.AllocHGlobal(length * Marshal.SizeOf(typeof(T)));
            ++NativeLeaks.Live;
        }

        public int Length { get; private set; }
        public bool IsCreated => buffer != IntPtr.Zero;

        public void Dispose()
        {
            if (!IsCreated) throw new ObjectDisposedException("NativeArray");
            Marshal.FreeHGlobal(buffer);
            buffer = IntPtr.Zero;
            --NativeLeaks.Live;
        }
    }
}

namespace Unity.Collections.LowLevel.Unsafe
{
    public static unsafe class NativeArrayUnsafeUtility
    {
        public static void* GetUnsafePtr<T>(this NativeArray<T> nativeArray) where T : struct
        {
            return (void*)nativeArray.buffer;
        }
    }
}
