// The engine-free core under Mono on a small model. Arguments: MODEL.
using System;
using System.Collections.Generic;
using System.IO;
using System.Linq;
using System.Threading;
using DCloth;
using static TestRun;

internal static unsafe class CoreTest
{
    private const int LongRun = 10000;
    private static byte[] file;
    private static object kept;

    // Joints at different heights, turned about +Y; columns contiguous.
    private static void Pose(ClothPlayer player, float yaw)
    {
        float c = (float)Math.Cos(yaw), s = (float)Math.Sin(yaw);
        for (int j = 0; j < player.Bones.Length; ++j)
        {
            float* m = player.JointMatrices + 16 * j;
            for (int i = 0; i < 16; ++i) m[i] = i % 5 == 0 ? 1 : 0;
            m[0] = m[10] = c;
            m[2] = -s;
            m[8] = s;
            m[13] = 1 + 0.1f * j;
        }
    }

    private static byte[] Drawn(ClothPlayer player)
    {
        var bytes = new byte[player.VertexCount * player.VertexBytes];
        for (int i = 0; i < bytes.Length; ++i) bytes[i] = player.Vertices[i];
        return bytes;
    }

    private static ClothPlayer NewPlayer(ClothModel model, float[] uv = null)
    {
        return new ClothPlayer(model, ClothSpace.Unity, model.JointNames, "", uv);
    }

    public static void OpenDescribesTheModel()
    {
        using (ClothModel model = ClothModel.Open(file))
        {
            Check(model.VertexCount > 0 && model.TriangleCount > 0 && model.JointNames.Length > 0, "counts");
            Check(model.JointNames.Distinct().Count() == model.JointNames.Length, "joints have names of their own");
            Check(model.Stages == ClothStages.Mesh && model.TickSeconds > 0 &&
                  model.Precision == "test", "description");
            Check(model.FileBytes == file.Length && model.ClothBytes % Native.DCLOTH_ALIGNMENT == 0, "bytes");
        }
    }

    // The garment's vertices to the bit, then those of the seam once more.
    public static void TexturedVerticesRepeatTheSeam()
    {
        using (ClothModel model = ClothModel.Open(file))
        {
            float[] uv = model.TextureCoordinates(), plainUv = new float[2 * model.VertexCount];
            int count = model.TexturedVertexCount;
            Check(count > model.VertexCount && uv.Length == 2 * count, "counts");
            Array.Copy(uv, plainUv, plainUv.Length);
            ushort[] triangles = model.Triangles(true), textured = model.TexturedTriangles(true);
            using (ClothPlayer plain = NewPlayer(model, plainUv), player = NewPlayer(model, uv))
            {
                Check(player.Textured && !plain.Textured && player.VertexCount == count, "textured");
                foreach (ClothPlayer each in new[] { plain, player })
                {
                    Turn(each);
                    Check(each.Advance(1 / 30f) == ClothStatus.Ok, "frame");
                }
                byte[] expected = Drawn(plain), drawn = Drawn(player);
                int seams = 0;
                for (int i = 0; i < textured.Length; ++i)
                {
                    int at = player.VertexBytes * textured[i], from = plain.VertexBytes * triangles[i];
                    if (textured[i] != triangles[i]) ++seams;
                    for (int b = 0; b < 24; ++b) Check(drawn[at + b] == expected[from + b], "vertex " + textured[i]);
                }
                Check(seams > 0, "seams");
            }
        }
    }

    // Axes x, y, z of each bone called y, z, x, and twice as long.
    private static void Turn(ClothPlayer player)
    {
        for (int j = 0; j < player.Bones.Length; ++j)
        {
            float* m = player.JointMatrices + 16 * j;
            var linear = new float[12];
            for (int i = 0; i < 12; ++i) linear[i] = m[i];
            for (int i = 0; i < 12; ++i) m[(i + 4) % 12] = 2 * linear[i];
        }
    }

    public static void CharactersThatCannotWearTheGarmentAreRefused()
    {
        using (ClothModel model = ClothModel.Open(file))
        {
            var matrices = new float[16 * model.JointNames.Length];
            for (int i = 0; i < matrices.Length; ++i) matrices[i] = i % 16 % 5 == 0 ? 1 : 0;
            var character = new ClothCharacter { BoneNames = model.JointNames, BindMatrices = matrices };
            Func<ClothStatus, string> textOf = status =>
                Refused(() => new ClothPlayer(model, ClothSpace.Unity, character), status).Message;
            string text = textOf(ClothStatus.Joints);
            Check(text.Contains("no pair of legs or arms") && text.Contains("allowed: "), text);
            character.BodyPositions = new float[3];
            text = textOf(ClothStatus.Argument);
            Check(text.Contains("BodyBones has 0 elements; allowed: 4"), text);
            character.BindMatrices = new float[7];
            text = textOf(ClothStatus.Argument);
            Check(text.Contains("BindMatrices has 7 elements; allowed: " + matrices.Length), text);
        }
    }

    public static void ARigWithAxesOfItsOwnWearsTheGarmentOnceItsBindPoseIsKnown()
    {
        using (ClothModel model = ClothModel.Open(file))
        using (ClothPlayer plain = NewPlayer(model), turned = NewPlayer(model), untold = NewPlayer(model))
        {
            Pose(plain, 0);
            plain.TakeBindPose();
            Pose(turned, 0);
            Turn(turned);
            turned.TakeBindPose();
            for (int frame = 0; frame < 5; ++frame)
            {
                foreach (ClothPlayer player in new[] { plain, turned, untold })
                {
                    Pose(player, 0.1f * frame);
                    if (player != plain) Turn(player);
                    Check(player.Advance(1 / 30f) == ClothStatus.Ok, "frame " + frame);
                }
            }
            float off = 0, untoldOff = 0;
            for (int v = 0; v < plain.VertexCount * plain.VertexBytes / 4; v += v % 6 == 2 ? 4 : 1)
            {
                off = Math.Max(off, Math.Abs(((float*)turned.Vertices)[v] - ((float*)plain.Vertices)[v]));
                untoldOff = Math.Max(untoldOff, Math.Abs(((float*)untold.Vertices)[v] - ((float*)plain.Vertices)[v]));
            }
            Check(off < 1e-5f, off + " m off");
            Check(untoldOff > 0.05f, "without it " + untoldOff + " m off");
            for (int i = 0; i < 16; ++i) turned.JointMatrices[i] = 0;
            ClothException e = Refused(() => turned.TakeBindPose(), ClothStatus.Pose);
            Check(e.Message.Contains("no inverse for joint '" + model.JointNames[0] + "'"), e.Message);
        }
    }

    public static void DamagedFilesAreRefusedWithWords()
    {
        foreach (int size in new[] { 0, 1, 64, file.Length / 128 * 64, file.Length - 64 })
        {
            byte[] cut = file.Take(size).ToArray();
            ClothException e = Refused(() => ClothModel.Open(cut, "cut.dcloth"), ClothStatus.Format);
            Check(e.Message.StartsWith("cut.dcloth: ") && e.Message.Length > 40, size + " bytes: " + e.Message);
        }
        byte[] other = (byte[])file.Clone();
        other[4] ^= 1; // of the identifier
        Check(Refused(() => ClothModel.Open(other), ClothStatus.Format).OffsetBytes == 4, "the identifier's place");
    }

    public static void MemoryComesBackInAnyOrder()
    {
        long before = AlignedMemory.LiveBytes;
        ClothModel model = ClothModel.Open(file);
        ClothPlayer player = NewPlayer(model), second = NewPlayer(model);
        model.Dispose();
        model.Dispose();
        second.Dispose();
        second.Dispose();
        Pose(player, 0);
        Check(player.Advance(1 / 60f) == ClothStatus.Ok, "a cloth outlives its model's Dispose");
        Check(AlignedMemory.LiveBytes > before + file.Length, "its bytes are still there");
        player.Dispose();
        Check(AlignedMemory.LiveBytes == before, "all is given back");
        foreach (Action use in new Action[] { () => player.Advance(0), () => new ClothInstance(model), player.Reset })
        {
            try
            {
                use();
                Check(false, "used after Dispose");
            }
            catch (ObjectDisposedException)
            {
            }
        }
        Refused(() => ClothModel.Open(new byte[64]), ClothStatus.Format);
        Check(AlignedMemory.LiveBytes == before, "nothing is left of a refused file");
    }

    public static void BlocksStandOnTheAlignment()
    {
        foreach (long size in new long[] { 0, 1, 7, 63, 64, 4097 })
        {
            using (var block = new AlignedMemory(size))
            {
                Check((ulong)block.Start % Native.DCLOTH_ALIGNMENT == 0 && block.Size == size, "block of " + size);
                for (long i = 0; i < size; ++i) Check(block.Start[i] == 0, "zeroed");
            }
        }
    }

    public static void OnlyTheBonesNeededAreRead()
    {
        using (ClothModel model = ClothModel.Open(file))
        {
            var bones = new List<string> { "tail", null, "rig:nothing" };
            bones.AddRange(model.JointNames.Reverse().Select(n => "rig:" + n));
            bones.AddRange(model.JointNames); // later ones of equal names
            using (var player = new ClothPlayer(model, ClothSpace.Unity, bones, "rig:"))
            {
                Check(player.Bones.SequenceEqual(Enumerable.Range(3, model.JointNames.Length)),
                      "the first of each name");
            }
            string absent = model.JointNames[1];
            List<string> fewer = bones.Where(b => b == null || !b.EndsWith(absent)).ToList();
            ClothException e = Refused(() => new ClothPlayer(model, ClothSpace.Unity, fewer, "rig:"),
                                       ClothStatus.Joints);
            Check(e.Message.Contains(absent), "the message names " + absent + ": " + e.Message);
            Refused(() => new ClothPlayer(model, ClothSpace.Make(0, 0, 4, 1), bones, "rig:"), ClothStatus.Argument);
            Refused(() => NewPlayer(model, new float[3]), ClothStatus.Argument);
        }
    }

    public static void RefusedFramesChangeNothing()
    {
        using (ClothModel model = ClothModel.Open(file))
        using (ClothPlayer player = NewPlayer(model), untouched = NewPlayer(model))
        {
            foreach (float yaw in new[] { 0, 0.1f, 0.2f })
            {
                Pose(player, yaw);
                Pose(untouched, yaw);
                Check(player.Advance(1 / 60f) == ClothStatus.Ok, "frame");
                Check(untouched.Advance(1 / 60f) == ClothStatus.Ok, "frame of the other");
                byte[] before = Drawn(player);
                Check(player.Advance(-1) == ClothStatus.Argument, "time below zero");
                Check(player.Advance(float.NaN) == ClothStatus.Argument, "NaN seconds");
                player.JointMatrices[3 * 16 + 12] = float.NaN;
                Check(player.Advance(1 / 60f) == ClothStatus.Pose, "NaN pose");
                Check(Drawn(player).SequenceEqual(before), "vertices stay");
                Check(Drawn(untouched).SequenceEqual(before), "as in a cloth that never saw it");
            }
        }
    }

    public static void ResetsAndStatesGoThrough()
    {
        using (ClothModel model = ClothModel.Open(file))
        using (ClothPlayer player = NewPlayer(model), other = NewPlayer(model))
        {
            for (int frame = 0; frame < 20; ++frame)
            {
                Pose(player, 0.1f * frame);
                player.Advance(1 / 30f);
            }
            byte[] state = player.Cloth.Save();
            other.Cloth.Restore(state);
            Pose(player, 2.1f);
            Pose(other, 2.1f);
            player.Advance(1 / 30f);
            other.Advance(1 / 30f);
            Check(Drawn(player).SequenceEqual(Drawn(other)), "a state goes on to the bit");
            state[state.Length / 2] ^= 1;
            Refused(() => other.Cloth.Restore(state), ClothStatus.Format);
            player.Reset();
            other.Reset();
            player.Stages = ClothStages.Static;
            player.Advance(1 / 30f);
            other.Advance(1 / 30f);
            Check(!Drawn(player).SequenceEqual(Drawn(other)), "stages are a level of detail");
            Check(player.Cloth.Describe().tick_share == 1, "one tick was run");
        }
    }

    public static void TangentsAndTrianglesFollowTheHost()
    {
        using (ClothModel model = ClothModel.Open(file))
        {
            ushort[] right = model.Triangles(false), left = model.Triangles(true);
            Check(right.Length == 3 * model.TriangleCount && right.Max() < model.VertexCount, "indices");
            for (int i = 0; i < right.Length; i += 3)
                Check(left[i] == right[i] && left[i + 1] == right[i + 2] && left[i + 2] == right[i + 1],
                      "turned round");
            Check(ClothSpace.IsLeftHanded(ClothSpace.Unity) && !ClothSpace.IsLeftHanded(ClothSpace.Model),
                  "handedness");
            Check(ClothSpace.IsLeftHanded(ClothSpace.Make(Native.DCLOTH_AXIS_MINUS_Y, Native.DCLOTH_AXIS_Z,
                                                          Native.DCLOTH_AXIS_X, 0.01f)), "Unreal's is left-handed");
            Check(!ClothSpace.IsLeftHanded(ClothSpace.Make(Native.DCLOTH_AXIS_X, Native.DCLOTH_AXIS_Z,
                                                           Native.DCLOTH_AXIS_MINUS_Y, 1)), "Blender's is not");
            var uv = new float[2 * model.VertexCount];
            for (int i = 0; i < uv.Length; ++i) uv[i] = i % 7 * 0.13f;
            using (ClothPlayer player = NewPlayer(model, uv), plain = NewPlayer(model))
            {
                Pose(player, 0.3f);
                Pose(plain, 0.3f);
                Check(player.Advance(0) == ClothStatus.Ok && plain.Advance(0) == ClothStatus.Ok, "frame");
                for (int i = 0; i < model.VertexCount; ++i)
                {
                    float* vertex = (float*)(player.Vertices + i * player.VertexBytes);
                    float* same = (float*)(plain.Vertices + i * plain.VertexBytes);
                    for (int c = 0; c < 6; ++c) Check(vertex[c] == same[c], "position and normal as without tangents");
                    Check(Math.Abs(vertex[9]) == 1, "w of the tangent");
                    for (int c = 0; c < 3; ++c)
                        Check(vertex[c] >= player.Bounds[c] && vertex[c] <= player.Bounds[3 + c], "inside the bounds");
                }
            }
        }
    }

    public static void TimersSeeEachStep()
    {
        using (ClothModel model = ClothModel.Open(file))
        using (ClothPlayer player = NewPlayer(model))
        using (var timer = new ClothTimer())
        {
            Pose(player, 0);
            dcloth_pose pose = new dcloth_pose { struct_size = (uint)sizeof(dcloth_pose),
                                                 joint_count = (uint)player.Bones.Length,
                                                 joint_matrices = player.JointMatrices, column_major = 1 };
            for (int tick = 0; tick < 50; ++tick)
                Check(player.Cloth.Tick(&pose, model.Stages, timer.Handle) == ClothStatus.Ok, "tick");
            Check(timer.Milliseconds(Native.DCLOTH_STEP_MESH) > 0, "time of the mesh stage");
            Check(timer.Milliseconds(Native.DCLOTH_STEP_NORMALS) == 0, "no normals in a tick");
            timer.Clear();
            Check(timer.Milliseconds(Native.DCLOTH_STEP_MESH) == 0, "cleared");
            timer.Dispose();
            foreach (Action use in new Action[] { timer.Clear, () => timer.Milliseconds(0) })
            {
                try
                {
                    use();
                    Check(false, "a timer used after Dispose");
                }
                catch (ObjectDisposedException)
                {
                }
            }
        }
    }

    // Bytes that `frames` take from the garbage-collected heap after a warm-up; `litter` makes some on purpose.
    private static long Garbage(ClothPlayer player, int frames, bool litter)
    {
        long before = 0;
        for (int frame = -100; frame < frames; ++frame)
        {
            if (frame == 0) before = GC.GetAllocatedBytesForCurrentThread();
            Pose(player, 0.01f * frame);
            if (frame % 1000 == 999) player.Jump();
            player.Stages = frame % 300 < 200 ? ClothStages.Mesh : ClothStages.Static;
            player.Pipelined = frame % 2 == 0;
            if (player.Advance(1 / 60f, frame % 50 != 0) != ClothStatus.Ok) Check(false, "frame " + frame);
            if (litter && frame == frames / 2) kept = new byte[1];
        }
        return GC.GetAllocatedBytesForCurrentThread() - before;
    }

    public static void FramesMakeNoGarbage()
    {
        using (ClothModel model = ClothModel.Open(file))
        using (ClothPlayer player = NewPlayer(model, new float[2 * model.VertexCount]))
        {
            int collections = GC.CollectionCount(0);
            long bytes = Garbage(player, LongRun, false);
            Check(bytes == 0, bytes + " bytes of garbage");
            Check(GC.CollectionCount(0) == collections, "no collection");
            Check(Garbage(player, 1000, true) > 0 && kept != null, "one byte array in a thousand frames is seen");
            Console.WriteLine("{0} frames: {1} bytes of garbage", LongRun, bytes);
        }
    }

    // As jobs do it: each player on a thread of its own, all of one model.
    public static void PlayersOnManyThreadsDrawTheSame()
    {
        const int count = 8, frames = 200;
        using (ClothModel model = ClothModel.Open(file))
        {
            var drawn = new byte[2][][];
            for (int way = 0; way < 2; ++way)
            {
                var players = new ClothPlayer[count];
                var threads = new Thread[count];
                for (int i = 0; i < count; ++i)
                {
                    int own = i;
                    players[i] = NewPlayer(model);
                    players[i].Pipelined = i % 2 == 0;
                    threads[i] = new Thread(() =>
                    {
                        for (int frame = 0; frame < frames; ++frame)
                        {
                            Pose(players[own], 0.01f * frame * (own + 1));
                            players[own].Advance(1 / 60f);
                        }
                    });
                    threads[i].Start();
                    if (way == 0) threads[i].Join();
                }
                foreach (Thread thread in threads) thread.Join();
                Check(players.All(player => player.LastStatus == ClothStatus.Ok), "frames are drawn");
                drawn[way] = players.Select(Drawn).ToArray();
                foreach (ClothPlayer player in players) player.Dispose();
            }
            for (int i = 0; i < count; ++i) Check(drawn[0][i].SequenceEqual(drawn[1][i]), "player " + i);
            Check(!drawn[0][0].SequenceEqual(drawn[0][1]), "players differ");
        }
    }

    private static int Main(string[] arguments)
    {
        if (arguments.Length != 1) return 2;
        file = File.ReadAllBytes(arguments[0]);
        return TestRun.All(typeof(CoreTest));
    }
}
