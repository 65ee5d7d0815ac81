// The components under Mono, in a stand-in for Unity (stand_in/). Arguments: MODEL SKIRT SEQUENCE.
using System;
using System.IO;
using System.Linq;
using System.Reflection;
using DCloth;
using DCloth.Editor;
using DCloth.Samples;
using DCloth.Samples.Editor;
using Unity.Collections;
using UnityEditor;
using UnityEditor.AssetImporters;
using UnityEngine;
using UnityEngine.Rendering;
using static TestRun;

internal static unsafe class ComponentsTest
{
    private const int LongRun = 10000;
    private static string modelPath, skirtPath, sequencePath;

    private static DClothAsset Imported(string path)
    {
        var context = new AssetImportContext(path);
        new DClothImporter().OnImportAsset(context);
        Check(context.Errors.Count == 0 && context.Warnings.Count == 0, "imports " + path);
        return (DClothAsset)context.Main;
    }

    private static void Set(object target, string field, object value)
    {
        target.GetType().GetField(field, BindingFlags.Instance | BindingFlags.NonPublic).SetValue(target, value);
    }

    // Bones of the model among others, under `root`; at different heights.
    private static SkinnedMeshRenderer Character(DClothAsset garment, Transform root, string without = null)
    {
        var names = new[] { "tail" }.Concat(garment.JointNames.Where(n => n != without).Reverse()).ToArray();
        var bones = new Transform[names.Length];
        for (int i = 0; i < bones.Length; ++i)
        {
            bones[i] = new GameObject(names[i]).transform;
            bones[i].SetParent(root, false);
            bones[i].localPosition = new Vector3(0.1f * i, 1 + 0.05f * i, 0);
        }
        var skin = new GameObject("Body").AddComponent<SkinnedMeshRenderer>();
        skin.bones = bones;
        return skin;
    }

    private static void Turn(SkinnedMeshRenderer skin, float yaw)
    {
        var forward = new Vector3((float)Math.Sin(yaw), 0, (float)Math.Cos(yaw));
        Quaternion rotation = Quaternion.LookRotation(forward, new Vector3(0, 1, 0));
        foreach (Transform bone in skin.bones) bone.localRotation = rotation;
    }

    private static DClothRenderer Renderer(DClothAsset garment, SkinnedMeshRenderer skin,
                                           Action<DClothRenderer> more = null)
    {
        var holder = new GameObject("Garment");
        holder.SetActive(false);
        var cloth = holder.AddComponent<DClothRenderer>();
        cloth.Configure(garment, skin, new Material());
        more?.Invoke(cloth);
        holder.SetActive(true);
        return cloth;
    }

    private static void End(DClothRenderer cloth, DClothAsset garment)
    {
        UnityEngine.Object.DestroyImmediate(cloth.gameObject);
        UnityEngine.Object.DestroyImmediate(garment);
        GameObject.Scripts.Clear();
        Debug.Errors.Clear();
        Debug.Warnings.Clear();
        Check(AlignedMemory.LiveBytes == 0 && NativeLeaks.Live == 0, "all memory is given back");
    }

    private static Mesh Drawn(DClothRenderer cloth)
    {
        return cloth.DrawnRenderer.GetComponent<MeshFilter>().sharedMesh;
    }

    public static void TheImporterChecksFiles()
    {
        DClothAsset asset = Imported(modelPath);
        Check(asset.VertexCount > 0 && asset.TriangleCount > 0 && asset.JointNames.Length > 0, "counts");
        Check(asset.Garment == "tube" && asset.Precision == "test", "description");
        Check(asset.Model.VertexCount == asset.VertexCount && ReferenceEquals(asset.Model, asset.Model), "one model");
        UnityEngine.Object.DestroyImmediate(asset);
        Check(AlignedMemory.LiveBytes == 0, "its memory goes with the asset");

        string broken = modelPath + ".broken.dcloth";
        File.WriteAllBytes(broken, File.ReadAllBytes(modelPath).Take(4096).ToArray());
        var context = new AssetImportContext(broken);
        new DClothImporter().OnImportAsset(context);
        Check(context.Errors.Count == 1 && context.Errors[0].StartsWith(Path.GetFileName(broken) + ": "), "one error");
        Check(context.Main == null && context.Objects.Count == 0, "and no asset");
        var attribute = typeof(DClothImporter).GetCustomAttribute<ScriptedImporterAttribute>();
        Check(attribute.Extension == "dcloth", "the files it takes");
    }

    public static void TheMeshHoldsWhatThePlayerDraws()
    {
        DClothAsset garment = Imported(modelPath);
        SkinnedMeshRenderer skin = Character(garment, new GameObject("Root").transform);
        DClothRenderer cloth = Renderer(garment, skin);
        Mesh mesh = Drawn(cloth);
        Check(mesh.IsDynamic && mesh.Indices.SequenceEqual(garment.Model.Triangles(true)), "clockwise triangles");
        var attributes = new[] { VertexAttribute.Position, VertexAttribute.Normal };
        Check(mesh.Layout.Select(a => a.attribute).SequenceEqual(attributes) && mesh.Strides[0] == 24, "layout");
        string[] names = skin.bones.Select(b => b.name).ToArray();
        using (var player = new ClothPlayer(garment.Model, ClothSpace.Unity, names))
        {
            player.Pipelined = true;
            for (int frame = 0; frame < 60; ++frame)
            {
                Turn(skin, 0.1f * frame);
                cloth.Visible = frame % 10 != 5;
                cloth.Stages = player.Stages = frame < 30 ? ClothStages.Mesh : ClothStages.Skeleton;
                if (frame == 40) cloth.ResetCloth();
                if (frame == 40) player.Reset();
                for (int j = 0; j < player.Bones.Length; ++j)
                    ((Matrix4x4*)player.JointMatrices)[j] = skin.bones[player.Bones[j]].localToWorldMatrix;
                Loop.Frame(1 / 60f);
                Check(player.Advance(1 / 60f, frame % 10 != 5) == ClothStatus.Ok, "frame");
                bool same = true;
                for (int i = 0; i < mesh.Streams[0].Length; ++i) same &= mesh.Streams[0][i] == player.Vertices[i];
                Check(same, "vertices of frame " + frame);
                Check(mesh.bounds.min.y == player.Bounds[1] && mesh.bounds.max.z == player.Bounds[5], "bounds");
                Check(cloth.DrawnRenderer.gameObject.activeSelf == cloth.Visible, "hidden where it is not drawn");
            }
        }
        Check(mesh.Uploads == 54, "frames not seen are not uploaded: " + mesh.Uploads);
        End(cloth, garment);
    }

    public static void FramesMakeNoGarbage()
    {
        DClothAsset garment = Imported(modelPath);
        SkinnedMeshRenderer skin = Character(garment, new GameObject("Root").transform);
        DClothRenderer cloth = Renderer(garment, skin, c => Set(c, "carrier", new GameObject("Train").transform));
        long before = 0;
        for (int frame = -100; frame < LongRun; ++frame)
        {
            if (frame == 0) before = GC.GetAllocatedBytesForCurrentThread();
            Loop.Frame(1 / 60f);
        }
        long bytes = GC.GetAllocatedBytesForCurrentThread() - before;
        Check(bytes == 0, bytes + " bytes of garbage");
        Check(Drawn(cloth).Uploads == LongRun + 100, "each frame was drawn");
        Console.WriteLine("{0} frames of the component: {1} bytes of garbage", LongRun, bytes);
        End(cloth, garment);
    }

    public static void FaultsAreSaidOnceAndHarmNothing()
    {
        DClothAsset garment = Imported(modelPath);
        Transform root = new GameObject("Root").transform;
        string absent = garment.JointNames[2];
        DClothRenderer cloth = Renderer(garment, Character(garment, root, absent));
        Check(!cloth.enabled && cloth.Player == null && Debug.Errors.Single().Contains(absent), "missing joint");
        Loop.Frame(1 / 60f);
        Check(Debug.Errors.Count == 1, "once");
        GameObject.Scripts.Clear();
        Check(!Renderer(null, null).enabled && Debug.Errors.Count == 2, "nothing set");
        var few = new Mesh { uv = new Vector2[3] };
        Check(!Renderer(garment, Character(garment, root), c => Set(c, "textureSource", few)).enabled, "foreign mesh");
        string allowed = (2 * garment.VertexCount).ToString();
        Check(Debug.Errors.Last().Contains(allowed), "what is allowed: " + Debug.Errors.Last());
        GameObject.Scripts.Clear();

        SkinnedMeshRenderer skin = Character(garment, root);
        cloth = Renderer(garment, skin);
        Loop.Frame(1 / 60f);
        byte[] last = (byte[])Drawn(cloth).Streams[0].Clone();
        Vector3 place = skin.bones[3].localPosition;
        skin.bones[3].localPosition = new Vector3(float.NaN, 0, 0);
        for (int frame = 0; frame < 5; ++frame) Loop.Frame(1 / 60f);
        Check(Debug.Warnings.Count == 1 && cloth.enabled, "one warning");
        Check(Drawn(cloth).Streams[0].SequenceEqual(last), "the mesh stays");
        skin.bones[3].localPosition = place;
        Loop.Frame(1 / 60f);
        Check(Drawn(cloth).Uploads == 2, "and goes on");

        cloth.enabled = false;
        Check(cloth.Player == null && cloth.DrawnRenderer == null && NativeLeaks.Live == 0, "disabled");
        cloth.enabled = true;
        UnityEngine.Object.DestroyImmediate(garment); // under a renderer that plays
        Loop.Frame(1 / 60f);
        Check(Drawn(cloth).Uploads == 1, "a renderer keeps what it plays");
        UnityEngine.Object.DestroyImmediate(cloth.gameObject);
        GameObject.Scripts.Clear();
        Check(AlignedMemory.LiveBytes == 0 && NativeLeaks.Live == 0, "all memory is given back");
        Debug.Errors.Clear();
        Debug.Warnings.Clear();
    }

    // The largest difference of what both draw.
    private static float Apart(DClothRenderer one, DClothRenderer other)
    {
        byte[] a = Drawn(one).Streams[0], b = Drawn(other).Streams[0];
        float worst = 0;
        for (int i = 0; i < a.Length; i += 4)
            worst = Math.Max(worst, Math.Abs(BitConverter.ToSingle(a, i) - BitConverter.ToSingle(b, i)));
        return worst;
    }

    // Bones turned by 1.2 in the bind pose, taken somewhere else than where the character then plays.
    public static void RigsWithAxesOfTheirOwnTellTheirBindPose()
    {
        const float Twist = 1.2f;
        DClothAsset garment = Imported(modelPath);
        Transform root = new GameObject("Root").transform, otherRoot = new GameObject("Root").transform;
        SkinnedMeshRenderer skin = Character(garment, root), twisted = Character(garment, otherRoot);
        DClothRenderer cloth = Renderer(garment, skin), told = Renderer(garment, twisted);
        DClothRenderer untold = Renderer(garment, twisted);
        Turn(skin, 0);
        cloth.TakeBindPose(root);
        otherRoot.localPosition = new Vector3(8, 0, -2);
        Turn(twisted, Twist);
        told.TakeBindPose(otherRoot);
        otherRoot.localPosition = new Vector3(0, 0, 0);
        for (int frame = 0; frame < 30; ++frame)
        {
            Turn(skin, 0.1f * frame);
            Turn(twisted, 0.1f * frame + Twist);
            Loop.Frame(1 / 60f);
        }
        Check(Apart(cloth, told) < 2e-5f, "the same garment: " + Apart(cloth, told));
        Check(Apart(cloth, untold) > 0.05f, "another one untold: " + Apart(cloth, untold));
        told.gameObject.SetActive(false);
        bool refused = false;
        try { told.TakeBindPose(otherRoot); }
        catch (InvalidOperationException) { refused = true; }
        Check(refused, "nothing to tell where the component is disabled");
        foreach (DClothRenderer more in new[] { told, untold }) UnityEngine.Object.DestroyImmediate(more.gameObject);
        End(cloth, garment);
    }

    public static void CarriersCarry()
    {
        DClothAsset garment = Imported(modelPath);
        Transform train = new GameObject("Train").transform;
        SkinnedMeshRenderer still = Character(garment, new GameObject("Root").transform);
        SkinnedMeshRenderer riding = Character(garment, train);
        DClothRenderer here = Renderer(garment, still);
        DClothRenderer there = Renderer(garment, riding, c => Set(c, "carrier", train));
        for (int frame = 0; frame < 30; ++frame)
        {
            train.localPosition = new Vector3(64 * frame, 0, 16);
            Turn(still, 0.1f * frame);
            Turn(riding, 0.1f * frame);
            Loop.Frame(1 / 60f);
        }
        Check(there.DrawnRenderer.transform.position.x == 64 * 29, "drawn where the train is");
        float worst = Apart(here, there);
        // Bones up to 1,856 m away are rounded to 0.06 mm on the way into the world and back. 1 mm is what shows.
        Check(worst < 1e-3f, "hangs as in a room that stands: " + worst);
        UnityEngine.Object.DestroyImmediate(here.gameObject);
        End(there, garment);
    }

    public static void BonesBelowTheRootBoneCount()
    {
        DClothAsset garment = Imported(modelPath);
        Transform root = new GameObject("Root").transform;
        SkinnedMeshRenderer whole = Character(garment, root);
        SkinnedMeshRenderer part = Character(garment, new GameObject("Other").transform);
        part.rootBone = root;
        part.bones = part.bones.Take(3).ToArray();
        DClothRenderer cloth = Renderer(garment, part);
        Check(cloth.enabled && Debug.Errors.Count == 0, "found: " + Debug.Errors.FirstOrDefault());
        var bones = (Transform[])typeof(DClothRenderer)
                        .GetField("bones", BindingFlags.Instance | BindingFlags.NonPublic).GetValue(cloth);
        Check(bones.Intersect(part.bones).Count() == 2, "the mesh's own first"); // one of the three is a tail
        Check(bones.Intersect(whole.bones).Count() == garment.JointNames.Length - 2, "the others below its root bone");
        End(cloth, garment);
    }

    public static void ScaledBonesAreToldOfAndUndone()
    {
        DClothAsset garment = Imported(modelPath);
        Transform root = new GameObject("Root").transform;
        SkinnedMeshRenderer plain = Character(garment, root), scaled = Character(garment, root);
        foreach (Transform bone in scaled.bones) bone.localScale = 128 * Vector3.one; // exact to divide by
        DClothRenderer a = Renderer(garment, plain);
        Check(Debug.Warnings.Count == 0, "bones as they are");
        DClothRenderer b = Renderer(garment, scaled);
        Check(Debug.Warnings.Count == 1 && Debug.Warnings[0].Contains("by 128;"), "told of scaled bones");
        b.enabled = false;
        Set(b, "boneScale", 128f);
        b.enabled = true;
        Check(Debug.Warnings.Count == 1, "and no more");
        for (int frame = 0; frame < 30; ++frame)
        {
            Turn(plain, 0.1f * frame);
            Turn(scaled, 0.1f * frame);
            Loop.Frame(1 / 60f);
        }
        Check(Drawn(a).Streams[0].SequenceEqual(Drawn(b).Streams[0]), "the same vertices");
        UnityEngine.Object.DestroyImmediate(a.gameObject);
        End(b, garment);
    }

    public static void TextureCoordinatesBringTangents()
    {
        DClothAsset garment = Imported(modelPath);
        var source = new Mesh { uv = new Vector2[garment.VertexCount] };
        for (int i = 0; i < source.uv.Length; ++i) source.uv[i] = new Vector2(i % 7 * 0.1f, i / 7 * 0.1f);
        SkinnedMeshRenderer skin = Character(garment, new GameObject("Root").transform);
        DClothRenderer cloth = Renderer(garment, skin, c => Set(c, "textureSource", source));
        Loop.Frame(1 / 60f);
        Mesh mesh = Drawn(cloth);
        Check(mesh.Strides[0] == 40 && mesh.Strides[1] == 8 && mesh.Layout.Length == 4, "layout");
        for (int v = 0; v < garment.VertexCount; ++v)
        {
            Check(Math.Abs(BitConverter.ToSingle(mesh.Streams[0], 40 * v + 36)) == 1, "w of tangent " + v);
            Check(BitConverter.ToSingle(mesh.Streams[1], 8 * v + 4) == source.uv[v].y, "v of vertex " + v);
        }
        End(cloth, garment);
    }

    public static void TheMenuMakesTheSamplesScene()
    {
        DClothAsset garment = Imported(skirtPath);
        garment.name = "skirt";
        var other = new TextAsset { name = "walk_turn_2" };
        var sequence = new TextAsset { name = "walk_turn", bytes = File.ReadAllBytes(sequencePath) };
        AssetDatabase.Project.AddRange(new UnityEngine.Object[] { garment, other });
        Camera.main = new GameObject("Main Camera").AddComponent<Camera>();
        SkirtSceneMenu.Create();
        Check(Selection.activeGameObject == null, "nothing is made");
        Check(Debug.Errors.Single().Contains("walk_turn.bytes"), "what is missing is named");
        Debug.Errors.Clear();
        AssetDatabase.Project.Add(sequence);
        SkirtSceneMenu.Create();
        for (int frame = 0; frame < 10; ++frame) Loop.Frame(1 / 30f);
        DClothRenderer cloth = GameObject.Scripts.OfType<DClothRenderer>().Single();
        Bounds bounds = Drawn(cloth).bounds;
        float depth = Camera.main.transform.position.z - bounds.max.z;
        Check(depth > 3 && Camera.main.transform.localToWorldMatrix.GetColumn(2).z < 0, "in front of the camera");
        Check(Selection.activeGameObject.GetComponent<SkirtSample>() != null, "and selected");
        Check(Debug.Errors.Count == 0 && Debug.Warnings.Count == 0, "no complaint");
        AssetDatabase.Project.Clear();
        End(cloth, garment);
    }

    public static void TheSamplePlaysTheSkirt()
    {
        var poses = new PoseSequence(File.ReadAllBytes(sequencePath));
        Check(poses.FrameCount == 150 && poses.FramesPerSecond == 30, "sequence");
        Check(poses.JointNames.Length == 15 && poses.JointNames.Contains("LeftUpLeg"), "its joints");
        DClothAsset garment = Imported(skirtPath);
        var holder = new GameObject("Sample");
        holder.SetActive(false);
        var sample = holder.AddComponent<SkirtSample>();
        sample.Configure(garment, new TextAsset { bytes = File.ReadAllBytes(sequencePath) }, new Material());
        holder.SetActive(true);
        Loop.Frame(1 / 30f);
        DClothRenderer cloth = GameObject.Scripts.OfType<DClothRenderer>().Single();
        var bones = cloth.GetComponent<SkinnedMeshRenderer>().bones.ToDictionary(b => b.name);
        Check(bones["LeftUpLeg"].position.x < 0 && bones["RightUpLeg"].position.x > 0, "left is at x below zero");
        byte[] before = null;
        int moved = 0, frames = 200; // beyond the end of the recording, at frame 149
        for (int frame = 0; frame < frames; ++frame)
        {
            Loop.Frame(1 / 30f);
            Bounds bounds = Drawn(cloth).bounds;
            Vector3 hips = bones["Hips"].position;
            Check(bounds.min.y > 0.1f && bounds.max.y < 1.3f && bounds.min.y < 0.7f, "height of frame " + frame);
            Check(bounds.min.x > hips.x - 1 && bounds.max.x < hips.x + 1 && bounds.min.z > hips.z - 1 &&
                  bounds.max.z < hips.z + 1, "around the hips in frame " + frame);
            byte[] now = (byte[])Drawn(cloth).Streams[0].Clone();
            if (before != null && !now.SequenceEqual(before)) ++moved;
            before = now;
        }
        Check(moved > 0.9 * frames, moved + " frames moved");
        Check(Debug.Errors.Count == 0 && Debug.Warnings.Count == 0, "no complaint");
        End(cloth, garment);
    }

    private static int Main(string[] arguments)
    {
        if (arguments.Length != 3) return 2;
        modelPath = arguments[0];
        skirtPath = arguments[1];
        sequencePath = arguments[2];
        return TestRun.All(typeof(ComponentsTest));
    }
}
