using System;
using System.Runtime.InteropServices;
using Unity.Collections;
using Unity.Collections.LowLevel.Unsafe;
using UnityEngine;
using UnityEngine.Rendering;

namespace DCloth
{
    /// <summary>A mesh of a garment, and the memory that its vertices are written to. Upload makes no
    /// garbage.</summary>
    internal sealed unsafe class ClothMesh : IDisposable
    {
        private const MeshUpdateFlags Trusted = MeshUpdateFlags.DontValidateIndices |
                                                MeshUpdateFlags.DontRecalculateBounds |
                                                MeshUpdateFlags.DontResetBoneBounds;
        private readonly ClothPlayer player;
        private NativeArray<PlainVertex> plain;
        private NativeArray<TangentVertex> full;

        /// <summary>`uv` as given to the player, or null.</summary>
        public ClothMesh(ClothModel model, ClothPlayer player, Vector2[] uv)
        {
            this.player = player;
            Mesh = new Mesh { name = model.Name, hideFlags = HideFlags.DontSave };
            Mesh.MarkDynamic();
            SetVertexLayout(uv);
            ushort[] triangles = player.Textured ? model.TexturedTriangles(true) : model.Triangles(true);
            Mesh.SetIndexBufferParams(triangles.Length, IndexFormat.UInt16);
            Mesh.SetIndexBufferData(triangles, 0, 0, triangles.Length, Trusted);
            Mesh.subMeshCount = 1;
            Mesh.SetSubMesh(0, new SubMeshDescriptor(0, triangles.Length), Trusted);
        }

        public Mesh Mesh { get; private set; }

        /// <summary>The last frame that the player drew.</summary>
        public void Upload()
        {
            if (full.IsCreated) Mesh.SetVertexBufferData(full, 0, 0, full.Length, 0, Trusted);
            else Mesh.SetVertexBufferData(plain, 0, 0, plain.Length, 0, Trusted);
            float* b = player.Bounds;
            var bounds = new Bounds();
            bounds.SetMinMax(new Vector3(b[0], b[1], b[2]), new Vector3(b[3], b[4], b[5]));
            Mesh.bounds = bounds;
        }

        /// <summary>After the player is disposed: it writes to memory that goes here.</summary>
        public void Dispose()
        {
            if (plain.IsCreated) plain.Dispose();
            if (full.IsCreated) full.Dispose();
            if (Mesh != null) UnityEngine.Object.Destroy(Mesh);
            Mesh = null;
        }

        private void SetVertexLayout(Vector2[] uv)
        {
            var position = new VertexAttributeDescriptor(VertexAttribute.Position, VertexAttributeFormat.Float32, 3, 0);
            var normal = new VertexAttributeDescriptor(VertexAttribute.Normal, VertexAttributeFormat.Float32, 3, 0);
            var tangent = new VertexAttributeDescriptor(VertexAttribute.Tangent, VertexAttributeFormat.Float32, 4, 0);
            var texture = new VertexAttributeDescriptor(VertexAttribute.TexCoord0, VertexAttributeFormat.Float32, 2, 1);
            int count = player.VertexCount;
            if (uv == null)
            {
                Mesh.SetVertexBufferParams(count, position, normal);
                plain = new NativeArray<PlainVertex>(count, Allocator.Persistent);
                player.LendVertices(plain.GetUnsafePtr(), (long)count * sizeof(PlainVertex));
                return;
            }
            Mesh.SetVertexBufferParams(count, position, normal, tangent, texture);
            Mesh.SetVertexBufferData(uv, 0, 0, count, 1, Trusted);
            full = new NativeArray<TangentVertex>(count, Allocator.Persistent);
            player.LendVertices(full.GetUnsafePtr(), (long)count * sizeof(TangentVertex));
        }

        [StructLayout(LayoutKind.Sequential)]
        private struct PlainVertex
        {
            public Vector3 Position, Normal;
        }

        [StructLayout(LayoutKind.Sequential)]
        private struct TangentVertex
        {
            public Vector3 Position, Normal;
            public Vector4 Tangent;
        }
    }
}
