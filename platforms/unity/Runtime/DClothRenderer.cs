using System;
using System.Collections.Generic;
using System.Runtime.InteropServices;
using Unity.Jobs;
using UnityEngine;
using UnityEngine.Rendering;
using UnityEngine.SceneManagement;

namespace DCloth
{
    /// <summary>A garment on a character: reads the bones of a SkinnedMeshRenderer after all animation, draws a mesh.
    /// Vertices are computed in world space, so the mesh is drawn by an object of its own outside of the character's
    /// hierarchy. It lives while this component is enabled.
    /// Cost: one update of the engine a frame, on a worker thread or on the main thread; no garbage.</summary>
    [AddComponentMenu("dcloth/DCloth Renderer")]
    [DefaultExecutionOrder(10000)] // after whatever moves bones in LateUpdate
    [DisallowMultipleComponent]
    public sealed unsafe class DClothRenderer : MonoBehaviour
    {
        [SerializeField] private DClothAsset garment;
        [SerializeField, Tooltip("Its bones, and those below its root bone, carry the garment; its mesh does not.")]
        private SkinnedMeshRenderer character;
        [SerializeField, Tooltip("Fit the garment to the skin and bind pose of that mesh: any humanoid rig. " +
                                 "Off: its bones have the names and axes of training.")]
        private bool fitted = true;
        [SerializeField, Tooltip("Taken off the bones' names before they are compared with the model's joints.")]
        private string bonePrefix = "";
        [SerializeField, Tooltip("What the file's units have scaled the bones by: 100 in many of Blender's.")]
        private float boneScale = 1;
        [SerializeField] private Material material;
        [SerializeField] private ShadowCastingMode shadows = ShadowCastingMode.TwoSided;
        [SerializeField, Tooltip("Optional, in place of the model's uv: a mesh with its vertices in its order.")]
        private Mesh textureSource;
        [SerializeField, Tooltip("Optional: what carries the character, a train for instance. Must not be scaled.")]
        private Transform carrier;
        [SerializeField] private ClothStages stages = ClothStages.Mesh;
        [SerializeField, Tooltip("Spread each tick over frames, so that no frame pays for all of it.")]
        private bool pipelined = true;
        [SerializeField, Tooltip("Update on a worker thread, beside the garments of other characters. Off: on the " +
                                 "main thread, at once.")]
        private bool onWorker = true;
        [SerializeField, Tooltip("Keep the garment outside of the body, where the model holds one.")]
        private bool outsideBody;

        [SerializeField, Tooltip("Metres a second in the world or, with a carrier, past it along its axes. For " +
                                 "garments that were trained with wind.")]
        private Vector3 wind;

        private ClothPlayer player;
        private ClothMesh mesh;
        private GameObject drawn;
        private Transform[] bones;
        private ClothStatus lastStatus;
        private GCHandle pinned; // for the job
        private JobHandle job;
        private bool working, unseen; // the job runs; what it made is not uploaded

        /// <summary>Level of detail; may change from frame to frame.</summary>
        public ClothStages Stages { get => stages; set => stages = value; }

        public bool Pipelined { get => pipelined; set => pipelined = value; }

        /// <summary>Update on a worker thread, beside the garments of other characters; or on the main
        /// thread.</summary>
        public bool OnWorker { get => onWorker; set => onWorker = value; }

        public bool OutsideBody { get => outsideBody; set => outsideBody = value; }

        /// <summary>Metres a second in the world or, with a carrier, past it along its axes; at most 100. Garments that
        /// were trained without wind ignore it.</summary>
        public Vector3 Wind { get => wind; set => wind = value; }

        /// <summary>Fit the garment to the character's skin and bind pose: any humanoid rig. Takes effect when this
        /// component is enabled. Player.Fit says how it fits.</summary>
        public bool Fitted { get => fitted; set => fitted = value; }

        /// <summary>False for a garment that is not seen: it keeps moving and is not drawn.</summary>
        public bool Visible { get; set; } = true;

        /// <summary>Draws the garment; null while disabled.</summary>
        public MeshRenderer DrawnRenderer => drawn == null ? null : drawn.GetComponent<MeshRenderer>();

        /// <summary>State, save and restore, and the engine's own calls; null while disabled. Waits for this frame's
        /// update.</summary>
        public ClothPlayer Player
        {
            get
            {
                WaitForJob();
                return player;
            }
        }

        /// <summary>For components made by scripts: call while this one is disabled, or its object inactive.</summary>
        public void Configure(DClothAsset newGarment, SkinnedMeshRenderer newCharacter, Material newMaterial)
        {
            garment = newGarment;
            character = newCharacter;
            material = newMaterial;
        }

        /// <summary>Before the frame in which the character is moved without motion (a portal, a new world origin): the
        /// cloth hangs as before.</summary>
        public void Jump()
        {
            Player?.Jump();
        }

        /// <summary>Before a cut, a spawn, another costume: forgets all motion.</summary>
        public void ResetCloth()
        {
            Player?.Reset();
        }

        /// <summary>For a rig whose bones have axes or scale of their own. Call once after this component was enabled,
        /// while the character stands in its bind pose: as training's did, and against `root`, unscaled, where that one
        /// stood against the origin. Throws ClothException, with the bone that has no inverse.</summary>
        public void TakeBindPose(Transform root)
        {
            if (Player == null) throw new InvalidOperationException("dcloth: " + name + " is not enabled");
            ReadBones(root);
            player.TakeBindPose();
        }

        private void OnEnable()
        {
            try
            {
                if (garment == null || character == null) throw new InvalidOperationException(
                    "needs a garment (a .dcloth file of the project) and a character (a SkinnedMeshRenderer)");
                Begin();
            }
            catch (Exception e) when (e is ClothException || e is InvalidOperationException)
            {
                Fail(e.Message);
            }
            catch (TypeLoadException e) // DllNotFoundException, EntryPointNotFoundException
            {
                Fail("no native library here, or another version's; see the package's README: " + e.Message);
            }
        }

        private void OnDisable()
        {
            End();
        }

        private void LateUpdate()
        {
            if (Player == null) return;
            ReadBones(carrier);
            player.Stages = stages;
            player.Pipelined = pipelined;
            player.OutsideBody = outsideBody;
            player.SetWind(wind.x, wind.y, wind.z);
            if (!onWorker)
            {
                player.Advance(Time.deltaTime, Visible);
                Show();
                return;
            }
            working = unseen = true;
            job = new ClothJob { Player = pinned, Seconds = Time.deltaTime, Draw = (byte)(Visible ? 1 : 0) }.Schedule();
            JobHandle.ScheduleBatchedJobs(); // it starts now, while other scripts go on
            ClothJobs.Add(this);
        }

        /// <summary>For ClothJobs, later in the frame.</summary>
        internal void FinishJob()
        {
            WaitForJob();
            if (!unseen) return; // disabled meanwhile
            unseen = false;
            Show();
        }

        private void WaitForJob()
        {
            if (!working) return;
            working = false;
            job.Complete();
        }

        private void Show()
        {
            ClothStatus status = player.LastStatus;
            if (status == ClothStatus.Ok)
            {
                Place();
                if (Visible) mesh.Upload();
            }
            else if (status != lastStatus) // once, not every frame
            {
                Debug.LogWarning("dcloth: frame refused (" + status + "): NaN or infinity in a bone's matrix", this);
            }
            lastStatus = status;
        }

        private void Begin()
        {
            if (!(boneScale > 0))
                throw new InvalidOperationException("Bone Scale is " + boneScale + "; allowed: above 0");
            ClothModel model = garment.Model;
            Vector2[] uv = textureSource != null ? textureSource.uv : OwnCoordinates(model);
            if (fitted && character.sharedMesh != null)
            {
                player = new ClothPlayer(model, ClothSpace.Unity, CharacterOf(character, boneScale), Flat(uv));
                bones = character.bones;
            }
            else
            {
                BeginByNames(model, uv);
            }
            pinned = GCHandle.Alloc(player);
            mesh = new ClothMesh(model, player, uv);
            drawn = new GameObject(name + " (dcloth)") { hideFlags = HideFlags.DontSave, layer = gameObject.layer };
            SceneManager.MoveGameObjectToScene(drawn, gameObject.scene);
            drawn.AddComponent<MeshFilter>().sharedMesh = mesh.Mesh;
            var renderer = drawn.AddComponent<MeshRenderer>();
            renderer.sharedMaterial = material;
            renderer.shadowCastingMode = shadows;
            lastStatus = ClothStatus.Ok;
            CheckScale();
        }

        private void BeginByNames(ClothModel model, Vector2[] uv)
        {
            // A mesh's own bones first, then those below its root bone that carry none of its vertices.
            var all = new List<Transform>(character.bones);
            if (character.rootBone != null) all.AddRange(character.rootBone.GetComponentsInChildren<Transform>(true));
            var names = new string[all.Count];
            for (int i = 0; i < names.Length; ++i) names[i] = all[i] == null ? "" : all[i].name;
            player = new ClothPlayer(model, ClothSpace.Unity, names, bonePrefix, Flat(uv));
            bones = new Transform[player.Bones.Length];
            for (int i = 0; i < bones.Length; ++i) bones[i] = all[player.Bones[i]];
        }

        // Bones and skin as the mesh was bound, upright, in the size that they have in the scene. A mesh that scripts
        // may not read gives no skin: the garment then follows the bones alone.
        private static ClothCharacter CharacterOf(SkinnedMeshRenderer skinned, float boneScale)
        {
            Mesh skin = skinned.sharedMesh;
            Matrix4x4[] binds = skin.bindposes;
            Transform[] own = skinned.bones;
            if (binds.Length == 0 || binds.Length != own.Length)
                throw new InvalidOperationException("its mesh has " + binds.Length + " bind poses for " + own.Length +
                                                    " bones; allowed: one each. Turn Fitted off for a mesh without");
            foreach (Transform bone in own)
            {
                if (bone == null) throw new InvalidOperationException("a bone of its mesh is missing in the scene");
            }
            float size = (own[0].localToWorldMatrix * binds[0]).GetColumn(0).magnitude;
            Quaternion upright = Quaternion.Inverse(skinned.transform.root.rotation) * skinned.transform.rotation;
            Matrix4x4 toWorld = Matrix4x4.TRS(new Vector3(0, 0, 0), upright, size * Vector3.one);
            var names = new string[own.Length];
            var matrices = new float[16 * own.Length];
            for (int i = 0; i < own.Length; ++i)
            {
                names[i] = own[i].name;
                Matrix4x4 bind = toWorld * binds[i].inverse;
                for (int k = 0; k < 16; ++k) matrices[16 * i + k] = k < 12 ? bind[k] / boneScale : bind[k];
            }
            var character = new ClothCharacter { BoneNames = names, BindMatrices = matrices };
            if (!skin.isReadable) return character;
            Vector3[] points = skin.vertices;
            BoneWeight[] weights = skin.boneWeights;
            character.BodyPositions = new float[3 * points.Length];
            character.BodyBones = new uint[4 * points.Length];
            character.BodyWeights = new float[4 * points.Length];
            for (int v = 0; v < points.Length; ++v)
            {
                Vector3 at = toWorld.MultiplyPoint3x4(points[v]);
                BoneWeight w = weights[v];
                Put(character.BodyPositions, 3 * v, at.x, at.y, at.z);
                Put(character.BodyWeights, 4 * v, w.weight0, w.weight1, w.weight2, w.weight3);
                character.BodyBones[4 * v] = (uint)w.boneIndex0;
                character.BodyBones[4 * v + 1] = (uint)w.boneIndex1;
                character.BodyBones[4 * v + 2] = (uint)w.boneIndex2;
                character.BodyBones[4 * v + 3] = (uint)w.boneIndex3;
            }
            int[] triangles = skin.triangles;
            character.BodyTriangles = new uint[triangles.Length];
            for (int i = 0; i < triangles.Length; ++i) character.BodyTriangles[i] = (uint)triangles[i];
            return character;
        }

        private static void Put(float[] array, int at, params float[] values)
        {
            for (int i = 0; i < values.Length; ++i) array[at + i] = values[i];
        }

        private void End()
        {
            WaitForJob();
            unseen = false;
            if (pinned.IsAllocated) pinned.Free();
            player?.Dispose();
            mesh?.Dispose();
            if (drawn != null) Destroy(drawn);
            player = null;
            mesh = null;
            drawn = null;
            bones = null;
        }

        // In `parent`'s frame or, with null, the world's. Matrix4x4 lies in memory column by column, as the player
        // wants it.
        private void ReadBones(Transform parent)
        {
            var matrices = (Matrix4x4*)player.JointMatrices;
            for (int i = 0; i < bones.Length; ++i) matrices[i] = bones[i].localToWorldMatrix;
            if (parent != null)
            {
                Matrix4x4 toParent = parent.worldToLocalMatrix;
                for (int i = 0; i < bones.Length; ++i) matrices[i] = toParent * matrices[i];
            }
            if (boneScale == 1) return;
            for (float* m = player.JointMatrices, end = m + 16 * bones.Length; m < end; m += 16)
            {
                for (int i = 0; i < 12; ++i) m[i] /= boneScale; // the axes; the place, in the last column, stays
            }
        }

        // A scale that training did not know goes into the network's input and the skinning. A giant is meant to be
        // one; a file's units are not.
        private void CheckScale()
        {
            for (int i = 0; i < bones.Length; ++i)
            {
                float found = bones[i].localToWorldMatrix.GetColumn(0).magnitude;
                if (found > 0.8f * boneScale && found < 1.25f * boneScale) continue;
                Debug.LogWarning("dcloth: " + name + ": bone '" + bones[i].name + "' is scaled by " + found +
                                 "; if the file's units are the reason, set Bone Scale to that", this);
                return;
            }
        }

        private void Place()
        {
            if (drawn.activeSelf != Visible) drawn.SetActive(Visible);
            if (carrier != null) drawn.transform.SetPositionAndRotation(carrier.position, carrier.rotation);
        }

        private void Fail(string why)
        {
            Debug.LogError("dcloth: " + name + ": " + why, this);
            End();
            enabled = false;
        }

        private static Vector2[] OwnCoordinates(ClothModel model)
        {
            if (model.TexturedVertexCount == 0) return null;
            float[] flat = model.TextureCoordinates();
            var uv = new Vector2[model.TexturedVertexCount];
            for (int i = 0; i < uv.Length; ++i) uv[i] = new Vector2(flat[2 * i], flat[2 * i + 1]);
            return uv;
        }

        private static float[] Flat(Vector2[] uv)
        {
            if (uv == null) return null;
            var flat = new float[2 * uv.Length];
            for (int i = 0; i < uv.Length; ++i)
            {
                flat[2 * i] = uv[i].x;
                flat[2 * i + 1] = uv[i].y;
            }
            return flat;
        }
    }
}
