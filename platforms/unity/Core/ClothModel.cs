using System;
using System.Threading;

namespace DCloth
{
    /// <summary>A checked .dcloth file. Any number of cloths share one; its memory is given back when it and all cloths
    /// made from it are disposed, in any order.
    /// Thread: any, as long as nothing is disposed meanwhile.</summary>
    public sealed unsafe class ClothModel : IDisposable
    {
        private readonly AlignedMemory bytes, storage;
        private readonly dcloth_model* model;
        private int owners = 1;
        private int disposed;

        private ClothModel(AlignedMemory bytes, string name)
        {
            this.bytes = bytes;
            try
            {
                storage = new AlignedMemory((long)(ulong)Native.dcloth_model_storage_size());
                dcloth_error error = ClothException.NewError();
                dcloth_model* opened = null;
                int status = Native.dcloth_model_open(bytes.Start, (UIntPtr)(ulong)bytes.Size, storage.Start,
                                                      (UIntPtr)(ulong)storage.Size, &opened, &error);
                ClothException.ThrowUnlessOk(status, &error, name);
                model = opened;
                ReadInfo();
            }
            catch
            {
                bytes.Dispose();
                storage?.Dispose();
                throw;
            }
        }

        public string Name { get; private set; }

        /// <summary>"fp32", "fp16", "int8" or what the converter was asked for.</summary>
        public string Precision { get; private set; }

        /// <summary>In the order of poses of cloths without BindJoints.</summary>
        public string[] JointNames { get; private set; }

        /// <summary>Index of the nearest joint above each one, -1 at the top. Null where the file does not tell: before
        /// format 1.5, or its bundle did not.</summary>
        public int[] JointParents { get; private set; }

        public int VertexCount { get; private set; }
        public int TriangleCount { get; private set; }

        /// <summary>Vertices of the mesh that a texture is drawn on: the garment's, then those repeated at seams. 0
        /// where the model holds no texture coordinates.</summary>
        public int TexturedVertexCount { get; private set; }

        /// <summary>The last stage that the model holds.</summary>
        public ClothStages Stages { get; private set; }

        public float TickSeconds { get; private set; }

        /// <summary>Vertices of the skin that cloth can be kept out of; 0 where the model holds none.</summary>
        public int BodyVertexCount { get; private set; }

        /// <summary>Whether ClothInstance.SetWind changes the garment's motion.</summary>
        public bool ReadsWind { get; private set; }

        public long FileBytes => bytes.Size;

        /// <summary>What each ClothInstance takes.</summary>
        public long ClothBytes { get; private set; }

        internal dcloth_model* Handle
        {
            get
            {
                if (disposed != 0) throw new ObjectDisposedException(nameof(ClothModel));
                return model;
            }
        }

        /// <summary>Copies `file`, a whole .dcloth file, into memory of its own. `name` begins the message of the
        /// exception.
        /// Errors: ClothException.</summary>
        public static ClothModel Open(byte[] file, string name = "model")
        {
            return new ClothModel(AlignedMemory.CopyOf(file), name);
        }

        /// <summary>Takes `file`, and disposes it also where it is refused. For loaders that want no second
        /// copy.</summary>
        public static ClothModel Open(AlignedMemory file, string name = "model")
        {
            if (file == null) throw new ArgumentNullException(nameof(file));
            return new ClothModel(file, name);
        }

        /// <summary>[TriangleCount, 3] vertex indices; front faces turn as the host's do: counter-clockwise in
        /// right-handed spaces, clockwise in left-handed ones.</summary>
        public ushort[] Triangles(bool leftHanded)
        {
            return Turned(Describe(Handle).triangles, leftHanded);
        }

        /// <summary>The same triangles by textured vertices; empty where TexturedVertexCount is 0.</summary>
        public ushort[] TexturedTriangles(bool leftHanded)
        {
            return TexturedVertexCount == 0 ? new ushort[0] : Turned(Describe(Handle).textured_triangles, leftHanded);
        }

        /// <summary>[TexturedVertexCount, 2] u to the right, v up as in Unity.</summary>
        public float[] TextureCoordinates()
        {
            dcloth_model_info info = Describe(Handle);
            var uv = new float[2 * TexturedVertexCount];
            for (int i = 0; i < uv.Length; i += 2)
            {
                uv[i] = info.texture_coordinates[i];
                uv[i + 1] = 1 - info.texture_coordinates[i + 1];
            }
            GC.KeepAlive(this);
            return uv;
        }

        /// <summary>[JointNames.Length, 16] joint to world in the bind pose of training: columns contiguous, metres, in
        /// the model's own space.</summary>
        public float[] BindMatrices()
        {
            var matrices = new float[16 * JointNames.Length];
            float* rows = stackalloc float[16];
            for (int j = 0; j < JointNames.Length; ++j)
            {
                ClothException.ThrowUnlessOk(Native.dcloth_model_joint_bind(Handle, (uint)j, rows), null, Name);
                for (int i = 0; i < 16; ++i) matrices[16 * j + i % 4 * 4 + i / 4] = rows[i];
            }
            GC.KeepAlive(this);
            return matrices;
        }

        public void Dispose()
        {
            if (Interlocked.Exchange(ref disposed, 1) == 0) Release();
        }

        internal void Retain()
        {
            Interlocked.Increment(ref owners);
        }

        internal void Release()
        {
            if (Interlocked.Decrement(ref owners) != 0) return;
            storage.Dispose();
            bytes.Dispose();
        }

        private ushort[] Turned(ushort* triangles, bool leftHanded)
        {
            var indices = new ushort[3 * TriangleCount];
            for (int i = 0; i < indices.Length; i += 3)
            {
                indices[i] = triangles[i];
                indices[i + 1] = triangles[i + (leftHanded ? 2 : 1)];
                indices[i + 2] = triangles[i + (leftHanded ? 1 : 2)];
            }
            GC.KeepAlive(this);
            return indices;
        }

        private static dcloth_model_info Describe(dcloth_model* model)
        {
            var info = new dcloth_model_info { struct_size = (uint)sizeof(dcloth_model_info) };
            ClothException.ThrowUnlessOk(Native.dcloth_model_describe(model, &info), null, "dcloth_model_describe");
            return info;
        }

        private void ReadInfo()
        {
            dcloth_model_info info = Describe(model);
            Name = Utf8.Text(info.name);
            Precision = Utf8.Text(info.precision);
            VertexCount = (int)info.vertex_count;
            TriangleCount = (int)info.triangle_count;
            TexturedVertexCount = (int)info.textured_vertex_count;
            Stages = (ClothStages)info.stages;
            TickSeconds = info.tick_seconds;
            ReadsWind = Native.dcloth_model_reads_wind(model) != 0;
            BodyVertexCount = (int)Native.dcloth_model_body_vertex_count(model);
            ClothBytes = (long)(ulong)Native.dcloth_cloth_storage_size(model);
            JointNames = new string[info.joint_count];
            var parents = new int[info.joint_count];
            for (uint j = 0; j < info.joint_count; ++j)
            {
                JointNames[j] = Utf8.Text(Native.dcloth_model_joint_name(model, j));
                parents[j] = Native.dcloth_model_joint_parent(model, j);
            }
            JointParents = Array.IndexOf(parents, Native.DCLOTH_JOINT_UNKNOWN) < 0 ? parents : null;
        }
    }
}
