using System.Collections.Generic;
using System.Runtime.InteropServices;
using Unity.Jobs;
using UnityEngine;

namespace DCloth
{
    /// <summary>Updates one garment on a worker thread. `Player` is a ClothPlayer: jobs may not hold
    /// references.</summary>
    internal struct ClothJob : IJob
    {
        public GCHandle Player;
        public float Seconds;
        public byte Draw;

        public void Execute()
        {
            ((ClothPlayer)Player.Target).Advance(Seconds, Draw != 0);
        }
    }

    /// <summary>Draws what the workers have made, once every renderer of the frame has started its own.</summary>
    [DefaultExecutionOrder(10100)] // after DClothRenderer
    [AddComponentMenu("")]
    internal sealed class ClothJobs : MonoBehaviour
    {
        private static ClothJobs instance;
        private readonly List<DClothRenderer> started = new List<DClothRenderer>();

        public static void Add(DClothRenderer renderer)
        {
            if (instance == null)
            {
                var host = new GameObject("dcloth jobs") { hideFlags = HideFlags.HideAndDontSave };
                instance = host.AddComponent<ClothJobs>();
            }
            instance.started.Add(renderer);
        }

        private void LateUpdate()
        {
            foreach (DClothRenderer renderer in started)
            {
                if (renderer != null) renderer.FinishJob();
            }
            started.Clear();
        }
    }
}
