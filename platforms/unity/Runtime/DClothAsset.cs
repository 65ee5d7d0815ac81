using UnityEngine;

namespace DCloth
{
    /// <summary>A .dcloth file in the project; what the importer makes of it. One model in memory serves all
    /// renderers.</summary>
    [PreferBinarySerialization]
    public sealed class DClothAsset : ScriptableObject
    {
        [SerializeField] private string garment = "", precision = "";
        [SerializeField] private int vertexCount, triangleCount;
        [SerializeField] private string[] jointNames = new string[0];
        [SerializeField, HideInInspector] private byte[] file = new byte[0];
        private ClothModel model;

        // What the inspector shows, known without opening the model; empty where it was imported unchecked.
        public string Garment => garment;
        public string Precision => precision;
        public int VertexCount => vertexCount;
        public int TriangleCount => triangleCount;
        public string[] JointNames => (string[])jointNames.Clone();

        /// <summary>Opened at the first use, which copies the file to memory outside of the garbage collector's heap.
        /// Errors: ClothException, DllNotFoundException.</summary>
        public ClothModel Model
        {
            get
            {
                if (model != null) return model;
                model = ClothModel.Open(file, name);
#if !UNITY_EDITOR
                file = new byte[0]; // a player reads it once; loading the asset again brings it back
#endif
                return model;
            }
        }

        /// <summary>Takes a whole .dcloth file. `check` opens it, which needs the native library.
        /// Errors: ClothException, DllNotFoundException.</summary>
        public void SetFile(byte[] bytes, string fileName, bool check)
        {
            if (check)
            {
                using (ClothModel opened = ClothModel.Open(bytes, fileName))
                {
                    garment = opened.Name;
                    precision = opened.Precision;
                    vertexCount = opened.VertexCount;
                    triangleCount = opened.TriangleCount;
                    jointNames = opened.JointNames;
                }
            }
            file = bytes;
        }

        // Renderers that still play keep the memory until they are disabled.
        private void OnDisable()
        {
            model?.Dispose();
            model = null;
        }
    }
}
