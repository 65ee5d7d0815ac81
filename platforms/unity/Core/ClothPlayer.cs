using System;
using System.Collections.Generic;

namespace DCloth
{
    /// <summary>A cloth with the memory it reads poses from and writes vertices to: all that a renderer component does,
    /// without an engine. Write JointMatrices, call Advance, draw Vertices.
    /// Thread: one at a time. Errors: set-up throws ClothException, frames return a status. Cost: Advance makes no
    /// garbage.</summary>
    public sealed unsafe class ClothPlayer : IDisposable
    {
        /// <summary>Bytes of a vertex: position and normal, three floats each; with tangents four more.</summary>
        public const int PlainVertexBytes = 24, TangentVertexBytes = 40;

        private const int MatrixFloats = 16, BoundsFloats = 6;
        private readonly ClothInstance cloth;
        private readonly AlignedMemory memory;
        private AlignedMemory ownVertices;
        private readonly float* textureCoordinates;
        private bool jumped;

        /// <summary>`boneNames` are the host's skeleton in any order, with more bones than the model needs; each name's
        /// `prefix` is taken off before it is compared ("mixamorig:" for instance). `uv`, two floats a vertex in the
        /// model's order, or null for vertices without tangents. Where they are those of
        /// ClothModel.TextureCoordinates, the player draws the textured vertices. Errors: Joints, with the names that
        /// are missing.</summary>
        public ClothPlayer(ClothModel model, dcloth_space space, IReadOnlyList<string> boneNames,
                           string prefix = "", float[] uv = null)
            : this(model, space, boneNames, prefix, null, uv)
        {
        }

        /// <summary>Fits the garment to `character` (ClothInstance.Fit); the pose then holds all of its bones. `Fit`
        /// says how it fits. Errors: Joints, Pose, Argument.</summary>
        public ClothPlayer(ClothModel model, dcloth_space space, ClothCharacter character, float[] uv = null)
            : this(model, space, null, "", character ?? throw new ArgumentNullException(nameof(character)), uv)
        {
        }

        private ClothPlayer(ClothModel model, dcloth_space space, IReadOnlyList<string> boneNames, string prefix,
                            ClothCharacter character, float[] uv)
        {
            cloth = new ClothInstance(model);
            try
            {
                VertexCount = model.VertexCount;
                if (uv != null && uv.Length == 2 * model.TexturedVertexCount)
                {
                    VertexCount = model.TexturedVertexCount;
                    Textured = true;
                }
                if (uv != null && uv.Length != 2 * VertexCount)
                {
                    string allowed = 2 * model.VertexCount + ", u and v of each vertex in the model's order";
                    if (model.TexturedVertexCount > 0)
                        allowed += ", or " + 2 * model.TexturedVertexCount + " of its textured ones";
                    throw new ClothException(ClothStatus.Argument, ulong.MaxValue, model.Name + ": " + uv.Length +
                                             " texture coordinates; allowed: " + allowed);
                }
                cloth.SetSpace(space);
                if (character == null)
                {
                    Bones = JointSelection.Bind(cloth, boneNames, prefix);
                }
                else
                {
                    Fit = cloth.Fit(character);
                    Bones = new int[character.BoneNames.Count];
                    for (int i = 0; i < Bones.Length; ++i) Bones[i] = i;
                }
                VertexBytes = uv == null ? PlainVertexBytes : TangentVertexBytes;
                long floats = (long)MatrixFloats * Bones.Length + BoundsFloats + (uv == null ? 0 : uv.Length);
                memory = new AlignedMemory(floats * sizeof(float));
                ownVertices = new AlignedMemory((long)VertexCount * VertexBytes);
                JointMatrices = (float*)memory.Start;
                Bounds = JointMatrices + (long)MatrixFloats * Bones.Length;
                textureCoordinates = uv == null ? null : Bounds + BoundsFloats;
                Vertices = ownVertices.Start;
                for (int i = 0; uv != null && i < uv.Length; ++i) textureCoordinates[i] = uv[i];
                Stages = model.Stages;
                HasBody = model.BodyVertexCount > 0;
            }
            catch
            {
                cloth.Dispose();
                memory?.Dispose();
                ownVertices?.Dispose();
                throw;
            }
        }

        public ClothInstance Cloth => cloth;

        /// <summary>How the garment fits the character of the constructor; struct_size is 0 without one.</summary>
        public dcloth_fit Fit { get; }

        /// <summary>For each matrix of the pose, the bone of `boneNames` it belongs to.</summary>
        public int[] Bones { get; }

        /// <summary>[Bones.Length, 16] joint to world, columns contiguous as in Unity's Matrix4x4. To be written before
        /// Advance.</summary>
        public float* JointMatrices { get; private set; }

        /// <summary>[VertexCount, VertexBytes] of the last frame drawn: position, normal, then tangent where there is
        /// one.</summary>
        public byte* Vertices { get; private set; }

        /// <summary>[6] least x, y, z, then greatest, of the last frame drawn.</summary>
        public float* Bounds { get; private set; }

        /// <summary>The model's, or its textured ones.</summary>
        public int VertexCount { get; }

        /// <summary>Whether vertices are those of ClothModel.TexturedTriangles.</summary>
        public bool Textured { get; }

        public int VertexBytes { get; }

        /// <summary>Whether OutsideBody does anything.</summary>
        public bool HasBody { get; }

        /// <summary>What the last Advance returned.</summary>
        public ClothStatus LastStatus { get; private set; }

        /// <summary>What runs from now on; more than the model holds counts as all of it.</summary>
        public ClothStages Stages { get; set; }

        /// <summary>Spreads a tick over the frames until the next one is due.</summary>
        public bool Pipelined { get; set; }

        /// <summary>Keeps vertices outside of the posed body.</summary>
        public bool OutsideBody { get; set; }

        /// <summary>The wind from now on, in host units a second along the host's axes, at most 100 m/s; models without
        /// ReadsWind ignore it. Argument where it is refused: then the wind before stays.</summary>
        public ClothStatus SetWind(float x, float y, float z)
        {
            return cloth.SetWind(x, y, z);
        }

        /// <summary>The character is moved without motion before the next frame: the cloth hangs as before.</summary>
        public void Jump()
        {
            jumped = true;
        }

        /// <summary>Forgets all motion before the next frame.</summary>
        public void Reset()
        {
            cloth.Reset();
            jumped = false;
        }

        /// <summary>From now on vertices go to `vertices`, memory of the host that stays where it is until Dispose or
        /// the next call; the player's own is given back. Errors: ArgumentException where `bytes` are fewer than
        /// VertexCount * VertexBytes, or the address is no multiple of 4.</summary>
        public void LendVertices(void* vertices, long bytes)
        {
            if (JointMatrices == null) throw new ObjectDisposedException(nameof(ClothPlayer));
            long needed = (long)VertexCount * VertexBytes;
            if (vertices == null || bytes < needed || (ulong)vertices % sizeof(float) != 0)
            {
                throw new ArgumentException(bytes + " bytes lent for vertices; needed: " + needed +
                                            " at a multiple of 4");
            }
            Vertices = (byte*)vertices;
            ownVertices?.Dispose();
            ownVertices = null;
        }

        /// <summary>For a rig whose bones have axes or scale of their own: JointMatrices hold its bind pose, the body
        /// as and where that of training stood. Errors: Pose, with the bone that has no inverse.</summary>
        public void TakeBindPose()
        {
            dcloth_pose pose = Pose();
            cloth.SetBindPose(&pose);
        }

        /// <summary>One frame, `seconds` after the last one. Without `draw` motion goes on and vertices stay. A refused
        /// frame (Pose: NaN in a matrix; Argument: time below zero or NaN) changes nothing, and a jump stays
        /// announced.</summary>
        public ClothStatus Advance(float seconds, bool draw = true)
        {
            dcloth_pose pose = Pose();
            dcloth_frame frame;
            frame.struct_size = (uint)sizeof(dcloth_frame);
            frame.stages = (uint)(Stages < cloth.Model.Stages ? Stages : cloth.Model.Stages);
            frame.seconds = seconds;
            frame.flags = (Pipelined ? Native.DCLOTH_FRAME_PIPELINED : 0) |
                          (jumped ? Native.DCLOTH_FRAME_JUMPED : 0);
            frame.error = null;
            dcloth_output output = Output();
            ClothStatus status = cloth.Update(&pose, &frame, draw ? &output : null);
            if (status == ClothStatus.Ok) jumped = false;
            LastStatus = status;
            GC.KeepAlive(this);
            return status;
        }

        public void Dispose()
        {
            cloth.Dispose();
            memory.Dispose();
            ownVertices?.Dispose();
            JointMatrices = null;
            Vertices = null;
            Bounds = null;
        }

        private dcloth_pose Pose()
        {
            if (JointMatrices == null) throw new ObjectDisposedException(nameof(ClothPlayer));
            dcloth_pose pose;
            pose.struct_size = (uint)sizeof(dcloth_pose);
            pose.joint_count = (uint)Bones.Length;
            pose.joint_matrices = JointMatrices;
            pose.column_major = 1;
            pose.padding = 0;
            return pose;
        }

        private dcloth_output Output()
        {
            dcloth_output output = default(dcloth_output);
            output.struct_size = (uint)sizeof(dcloth_output);
            output.vertex_count = (uint)VertexCount;
            output.positions = Vertices;
            output.normals = Vertices + 3 * sizeof(float);
            output.position_stride_bytes = output.normal_stride_bytes = (uint)VertexBytes;
            output.bounds = Bounds;
            output.flags = (OutsideBody ? Native.DCLOTH_OUTPUT_OUTSIDE_BODY : 0) |
                           (Textured ? Native.DCLOTH_OUTPUT_TEXTURED : 0);
            if (textureCoordinates == null) return output;
            output.tangents = Vertices + 6 * sizeof(float);
            output.tangent_stride_bytes = (uint)VertexBytes;
            output.texture_coordinates = textureCoordinates;
            output.texture_stride_bytes = 2 * sizeof(float);
            return output;
        }
    }
}
