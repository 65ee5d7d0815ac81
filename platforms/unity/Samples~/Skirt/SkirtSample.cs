using UnityEngine;

namespace DCloth.Samples
{
    /// <summary>Put on an empty object, with the three assets of the sample's README: plays a recorded motion on bones
    /// made here, and the skirt on them.</summary>
    public sealed class SkirtSample : MonoBehaviour
    {
        [SerializeField] private DClothAsset garment;
        [SerializeField, Tooltip("walk_turn.safetensors, renamed to end in .bytes")]
        private TextAsset sequence;
        [SerializeField] private Material material;
        [SerializeField, Range(0.1f, 2)] private float speed = 1;

        private PoseSequence poses;
        private Transform[] bones;
        private DClothRenderer cloth;
        private float seconds;

        /// <summary>Before the scene plays.</summary>
        public void Configure(DClothAsset newGarment, TextAsset newSequence, Material newMaterial)
        {
            garment = newGarment;
            sequence = newSequence;
            material = newMaterial;
        }

        private void Start()
        {
            poses = new PoseSequence(sequence.bytes);
            bones = new Transform[poses.JointNames.Length];
            for (int j = 0; j < bones.Length; ++j) bones[j] = NewBone(poses.JointNames[j]);
            var holder = new GameObject("Skirt");
            holder.transform.SetParent(transform, false);
            holder.SetActive(false); // until all is set
            var skin = holder.AddComponent<SkinnedMeshRenderer>();
            skin.bones = bones;
            cloth = holder.AddComponent<DClothRenderer>();
            cloth.Configure(garment, skin, material);
            Pose();
            holder.SetActive(true);
        }

        private void Update()
        {
            seconds += Time.deltaTime * speed;
            if (seconds * poses.FramesPerSecond > poses.FrameCount - 1)
            {
                seconds = 0;
                cloth.ResetCloth(); // a cut: the character stands elsewhere
            }
            Pose();
        }

        private Transform NewBone(string boneName)
        {
            var bone = new GameObject(boneName).transform;
            bone.SetParent(transform, false);
            // Shown by a small ball: scaling the bone itself would be part of the pose.
            Transform ball = GameObject.CreatePrimitive(PrimitiveType.Sphere).transform;
            ball.SetParent(bone, false);
            ball.localScale = 0.06f * Vector3.one;
            return bone;
        }

        // Between two frames of the recording.
        private void Pose()
        {
            float at = seconds * poses.FramesPerSecond;
            int frame = Mathf.Min((int)at, poses.FrameCount - 1), next = Mathf.Min(frame + 1, poses.FrameCount - 1);
            for (int j = 0; j < bones.Length; ++j)
            {
                bones[j].localPosition = Vector3.Lerp(Position(frame, j), Position(next, j), at - frame);
                bones[j].localRotation = Quaternion.Slerp(Rotation(frame, j), Rotation(next, j), at - frame);
            }
        }

        private Vector3 Column(int frame, int joint, int column)
        {
            return new Vector3(poses.UnityElement(frame, joint, 0, column), poses.UnityElement(frame, joint, 1, column),
                               poses.UnityElement(frame, joint, 2, column));
        }

        private Vector3 Position(int frame, int joint)
        {
            return Column(frame, joint, 3);
        }

        private Quaternion Rotation(int frame, int joint)
        {
            return Quaternion.LookRotation(Column(frame, joint, 2), Column(frame, joint, 1));
        }
    }
}
