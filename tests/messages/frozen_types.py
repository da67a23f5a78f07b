"""RIHS01 hashes of the message types, as the first release wrote them into logs."""

TYPE_HASHES = {
    "DoorAdded": "RIHS01_48f2cd57f8817d8c61039bfb3b6e2f1b629ecc0fc947222f6feb328cf7145fb5",
    "DoorUpdated": "RIHS01_3e49986880f120ba941d70b2d43e581ffd7131aabf45f5f943b3648af070e611",
    "DoorRemoved": "RIHS01_8d876f44b13f9b5e3dc6b69b4a7ee3f50b2e6bb85a1077858dc6d09ad5ab9c10",
    "DoorObserved": "RIHS01_1943b98c5acb9b89c7b24c877ad68029c007d317266b51534cea3026b55ca640",
    "DoorRequested": "RIHS01_e0a3f023ea9e0413bd27c02c3a2df650e221a0d4ea37cd22667e91f30e1558ff",
    "DoorPassed": "RIHS01_64a3655bff795306002eb1d9900e81a7922f23de68c0cd8a93522ed7da42145d",
    "PatrolStarted": "RIHS01_147791f93e82c879f66194685313c4d3c4d25282aefc3ffd71774bb67eea049b",
    "PatrolFinished": "RIHS01_e4c2c2a81fa45b19272a78acc9d68be7d9bd23a1da32a608d29f0311c38c352d",
    "RobotPose": "RIHS01_c6c7bdc1159125ed21d54aefd63bebb87c654f4073161f3f6ae3aa060d4fa257",
    "Retracted": "RIHS01_420c967519d5d75232def996988317d6b173d4bbb6cbf37fc18d6238060ad030",
    "DoorAnnotated": "RIHS01_fa6a3ba9b8c6fd73a1867e0162b3f61cc3627be40ddab7ae8aa930ecee113dcc",
    "LevelAdded": "RIHS01_00c9cea28dd9d5f2979a8cf93f28bc084018666bfdb6e6b72687a0a791fa2492",
    "LogExported": "RIHS01_a174d55b49b48f3b110381bb371cbac8bdd009828e2a0e31ef9e1c7e12bf94b8",
    "Commit": "RIHS01_30510ac739af49cd50a85384f4a7e214cff848fe12c33c6bb6b97c54f9a8930c",
    "CommitNote": "RIHS01_e495f9ceaca267d3baed47c574eb081900b5e74c2905efe81b3f9bff13242974",
    "Keyframe": "RIHS01_e1e0e5443d74cfa845198ec572bb32e9c2538c8f104fe5a15b4f21797b7f54ea",
}
